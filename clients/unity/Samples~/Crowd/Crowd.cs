using UnityEngine;

namespace Wayfarer.Samples
{
    /// <summary>
    /// People that walk about in an empty scene: put this onto an empty object, start the server, press Play. Without
    /// your characters they are stick figures.
    /// </summary>
    public sealed class Crowd : MonoBehaviour
    {
        public string server = "http://localhost:8080";

        [Range(1, 60)]
        public int people = 12;

        [Tooltip("Metres around this object.")]
        public float radius = 8;

        [Tooltip("Your characters, or none.")]
        public GameObject[] characters = new GameObject[0];

        private void Start()
        {
            GameObject ground = GameObject.CreatePrimitive(PrimitiveType.Plane); // 10 m × 10 m
            ground.transform.localScale = new Vector3(0.25f * radius, 1, 0.25f * radius);
            ground.transform.position = transform.position;

            var session = gameObject.AddComponent<WayfarerSession>();
            session.server = server;
            var spawner = gameObject.AddComponent<WayfarerSpawner>();
            spawner.prefabs = characters.Length > 0 ? characters : Figures();
            spawner.count = people;
            spawner.radius = radius;
            if (Camera.main != null)
            {
                Camera.main.transform.position = transform.position + new Vector3(0, 0.8f * radius, -1.6f * radius);
                Camera.main.transform.LookAt(transform.position + Vector3.up);
            }
        }

        private GameObject[] Figures()
        {
            var figures = new GameObject[6];
            for (int k = 0; k < figures.Length; k++)
            {
                figures[k] = StickFigure.Make("person", Color.HSVToRGB(k / 6f, 0.6f, 0.9f));
                figures[k].transform.SetParent(transform, false);
                figures[k].SetActive(false); // the spawner's copies are shown, not these
            }
            return figures;
        }
    }
}
