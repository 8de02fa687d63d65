using UnityEngine;

namespace Wayfarer.Samples
{
    /// <summary>A character without a file: a bar from each joint to the next. Its bones have the canonical names.</summary>
    public static class StickFigure
    {
        private static readonly float[] Offsets = // x, y, z of each joint from its parent's, in a T-pose
        {
            0.0f, 0.918f, 0.022f,
            -0.103f, -0.04f, -0.006f,
            0.103f, -0.04f, -0.006f,
            0.0f, 0.116f, -0.002f,
            0.0f, -0.382f, 0.0f,
            0.0f, -0.382f, 0.0f,
            0.0f, 0.109f, -0.005f,
            0.0f, -0.416f, 0.0f,
            0.0f, -0.416f, 0.0f,
            0.0f, 0.117f, -0.006f,
            0.0f, -0.054f, 0.141f,
            0.0f, -0.054f, 0.141f,
            0.0f, 0.158f, 0.009f,
            -0.06f, 0.131f, 0.019f,
            0.06f, 0.131f, 0.019f,
            0.0f, 0.059f, 0.018f,
            -0.103f, -0.064f, 0.007f,
            0.103f, -0.064f, 0.007f,
            -0.256f, 0.0f, 0.0f,
            0.256f, 0.0f, 0.0f,
            -0.217f, 0.0f, 0.0f,
            0.217f, 0.0f, 0.0f,
        };

        /// <summary>A new figure, which stands at the origin.</summary>
        public static GameObject Make(string name, Color colour)
        {
            var figure = new GameObject(name);
            var joints = new Transform[Bones.Count];
            for (int bone = 0; bone < Bones.Count; bone++)
            {
                int parent = Bones.Parents[bone];
                joints[bone] = new GameObject(Bones.Names[bone]).transform;
                joints[bone].SetParent(parent < 0 ? figure.transform : joints[parent], false);
                var offset = new Vector3(Offsets[3 * bone], Offsets[3 * bone + 1], Offsets[3 * bone + 2]);
                joints[bone].localPosition = offset;
                if (parent >= 0)
                {
                    AddBar(joints[parent], offset, 0.05f, colour);
                }
            }
            AddBar(joints[Bones.IndexOf("head")], new Vector3(0, 0.2f, 0), 0.16f, colour);
            foreach (string side in new[] { "left", "right" })
            {
                AddBar(joints[Bones.IndexOf(side + "_foot")], new Vector3(0, 0, 0.07f), 0.05f, colour);
            }
            return figure;
        }

        private static void AddBar(Transform joint, Vector3 to, float thick, Color colour)
        {
            GameObject bar = GameObject.CreatePrimitive(PrimitiveType.Cube);
            Object.Destroy(bar.GetComponent<Collider>());
            bar.name = "bar";
            bar.transform.SetParent(joint, false);
            bar.transform.localPosition = 0.5f * to;
            bar.transform.localRotation = Quaternion.FromToRotation(Vector3.up, to);
            bar.transform.localScale = new Vector3(thick, to.magnitude, thick);
            bar.GetComponent<Renderer>().material.color = colour;
        }
    }
}
