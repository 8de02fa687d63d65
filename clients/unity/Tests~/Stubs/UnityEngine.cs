// STUBS, for checking only: as much of UnityEngine as the package uses, so that its components can be compiled and run
// without Unity. Transforms, components and the order of messages work; nothing is drawn. Signatures are those of Unity
// 2021.3's scripting reference.
using System;
using System.Collections.Generic;
using System.Linq;
using System.Reflection;

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero => new Vector3(0, 0, 0);
        public static Vector3 one => new Vector3(1, 1, 1);
        public static Vector3 up => new Vector3(0, 1, 0);
        public float sqrMagnitude => x * x + y * y + z * z;
        public float magnitude => (float)Math.Sqrt(sqrMagnitude);
        public static Vector3 operator +(Vector3 a, Vector3 b) => new Vector3(a.x + b.x, a.y + b.y, a.z + b.z);
        public static Vector3 operator -(Vector3 a, Vector3 b) => new Vector3(a.x - b.x, a.y - b.y, a.z - b.z);
        public static Vector3 operator *(float f, Vector3 a) => new Vector3(f * a.x, f * a.y, f * a.z);
        public static Vector3 Scale(Vector3 a, Vector3 b) => new Vector3(a.x * b.x, a.y * b.y, a.z * b.z);
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity => new Quaternion(0, 0, 0, 1);
        public Vector3 eulerAngles // the yaw is right where it is the only turn
        {
            get { return new Vector3(0, (float)(2 * Math.Atan2(y, w) * 180 / Math.PI), 0); }
        }
        public static Quaternion Euler(float x, float y, float z)
        {
            if (x != 0 || z != 0) throw new NotImplementedException("the stub turns about y only");
            double half = y * Math.PI / 360;
            return new Quaternion(0, (float)Math.Sin(half), 0, (float)Math.Cos(half));
        }
        public static Quaternion FromToRotation(Vector3 from, Vector3 to)
        {
            float w = from.magnitude * to.magnitude + from.x * to.x + from.y * to.y + from.z * to.z;
            var q = new Quaternion(from.y * to.z - from.z * to.y, from.z * to.x - from.x * to.z, from.x * to.y - from.y * to.x, w);
            var n = (float)Math.Sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
            return n < 1e-9f ? new Quaternion(1, 0, 0, 0) : new Quaternion(q.x / n, q.y / n, q.z / n, q.w / n);
        }
        public static Quaternion Inverse(Quaternion q) => new Quaternion(-q.x, -q.y, -q.z, q.w);
        public static Quaternion operator *(Quaternion a, Quaternion b) => new Quaternion(
            a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            float tx = 2 * (q.y * v.z - q.z * v.y), ty = 2 * (q.z * v.x - q.x * v.z), tz = 2 * (q.x * v.y - q.y * v.x);
            return new Vector3(v.x + q.w * tx + q.y * tz - q.z * ty, v.y + q.w * ty + q.z * tx - q.x * tz, v.z + q.w * tz + q.x * ty - q.y * tx);
        }
    }

    public struct Color
    {
        public static Color HSVToRGB(float h, float s, float v) => new Color();
    }

    public class Object
    {
        public virtual string name { get; set; }
        public static void Destroy(Object found)
        {
            var gone = found as GameObject;
            if (gone != null) gone.Remove();
            var part = found as Component;
            if (part != null) part.gameObject.Drop(part);
        }
        public static T Instantiate<T>(T original, Transform parent) where T : Object
        {
            GameObject copy = ((GameObject)(Object)original).Copy();
            copy.transform.SetParent(parent, false);
            return (T)(Object)copy;
        }
    }

    public class Component : Object
    {
        public GameObject gameObject { get; internal set; }
        public Transform transform => gameObject.transform;
        public override string name { get { return gameObject.name; } set { gameObject.name = value; } }
        public T GetComponent<T>() => gameObject.GetComponent<T>();
        public T GetComponentInChildren<T>() => gameObject.GetComponentsInChildren<T>(false).FirstOrDefault();
        public T[] GetComponentsInChildren<T>(bool includeInactive) => gameObject.GetComponentsInChildren<T>(includeInactive);
    }

    public class Behaviour : Component
    {
        private bool on = true;
        public bool enabled
        {
            get { return on; }
            set { on = value; gameObject.Settle(); }
        }
        internal bool Woken, Told; // whether Awake has been sent; whether OnEnable was the last one sent
        internal bool Started;
    }

    public class MonoBehaviour : Behaviour { }

    public class Collider : Component { }

    public class Material : Object { public Color color { get; set; } }

    public class Renderer : Component { public Material material { get; } = new Material(); }

    public struct BoneWeight
    {
        public float weight0, weight1, weight2, weight3;
        public int boneIndex0, boneIndex1, boneIndex2, boneIndex3;
    }

    public struct Matrix4x4
    {
        public float[] Values; // the stub's own: by columns
        public float this[int index] => Values[index];
    }

    public class Mesh : Object
    {
        public bool isReadable => true;
        public Vector3[] vertices { get; set; } = new Vector3[0];
        public BoneWeight[] boneWeights { get; set; } = new BoneWeight[0];
        public Matrix4x4[] bindposes { get; set; } = new Matrix4x4[0];
    }

    public class SkinnedMeshRenderer : Renderer
    {
        public Transform[] bones { get; set; } = new Transform[0];
        public Mesh sharedMesh { get; set; }
    }

    public class Camera : Behaviour { public static Camera main => null; }

    public enum HumanBodyBones
    {
        Hips, LeftUpperLeg, RightUpperLeg, LeftLowerLeg, RightLowerLeg, LeftFoot, RightFoot, Spine, Chest, Neck, Head,
        LeftShoulder, RightShoulder, LeftUpperArm, RightUpperArm, LeftLowerArm, RightLowerArm, LeftHand, RightHand, LeftToes,
        RightToes, LeftEye, RightEye, Jaw, UpperChest = 54,
    }

    public class Animator : Behaviour
    {
        public readonly Dictionary<HumanBodyBones, Transform> Human = new Dictionary<HumanBodyBones, Transform>(); // the stub's own
        public bool isHuman => Human.Count > 0;
        public bool applyRootMotion { get; set; } = true;
        public Transform GetBoneTransform(HumanBodyBones bone) => Human.ContainsKey(bone) ? Human[bone] : null;
    }

    public class Transform : Component
    {
        private readonly List<Transform> children = new List<Transform>();
        public Transform parent { get; private set; }
        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; } = Quaternion.identity;
        public Vector3 localScale { get; set; } = Vector3.one;
        public int childCount => children.Count;
        public Transform GetChild(int index) => children[index];
        public Quaternion rotation
        {
            get { return parent == null ? localRotation : parent.rotation * localRotation; }
            set { localRotation = parent == null ? value : Quaternion.Inverse(parent.rotation) * value; }
        }
        public Vector3 eulerAngles => rotation.eulerAngles;
        public Vector3 position
        {
            get { return parent == null ? localPosition : parent.TransformPoint(localPosition); }
            set { localPosition = parent == null ? value : parent.InverseTransformPoint(value); }
        }
        public Vector3 lossyScale => parent == null ? localScale : Vector3.Scale(parent.lossyScale, localScale);
        public Vector3 TransformPoint(Vector3 p)
        {
            Vector3 own = localPosition + localRotation * Vector3.Scale(localScale, p);
            return parent == null ? own : parent.TransformPoint(own);
        }
        public Vector3 InverseTransformPoint(Vector3 p)
        {
            Vector3 off = Quaternion.Inverse(localRotation) * ((parent == null ? p : parent.InverseTransformPoint(p)) - localPosition);
            return new Vector3(off.x / localScale.x, off.y / localScale.y, off.z / localScale.z);
        }
        public void SetPositionAndRotation(Vector3 place, Quaternion turn) { rotation = turn; position = place; }
        public void SetParent(Transform to, bool worldPositionStays)
        {
            if (worldPositionStays) throw new NotImplementedException("the stub keeps local places");
            Detach();
            parent = to;
            if (to != null) to.children.Add(this);
            gameObject.Settle();
        }
        public void LookAt(Vector3 place) { }
        internal void Detach() { if (parent != null) parent.children.Remove(this); parent = null; }
    }

    public enum PrimitiveType { Cube = 3, Plane = 4 }

    public sealed class GameObject : Object
    {
        private readonly List<Component> parts = new List<Component>();
        private bool active = true, gone;
        public GameObject(string name) { this.name = name; transform = AddComponent<Transform>(); Stage.Add(this); }
        public Transform transform { get; }
        public bool activeInHierarchy => active && !gone && (transform.parent == null || transform.parent.gameObject.activeInHierarchy);
        public void SetActive(bool value) { active = value; Settle(); }
        public T AddComponent<T>() where T : Component => (T)Add(typeof(T));
        public T GetComponent<T>() => parts.OfType<T>().FirstOrDefault();
        public T[] GetComponentsInChildren<T>(bool includeInactive)
        {
            return Below().Where(each => includeInactive || each.activeInHierarchy).SelectMany(each => each.parts.OfType<T>()).ToArray();
        }
        public static GameObject CreatePrimitive(PrimitiveType type)
        {
            var made = new GameObject(type.ToString());
            made.AddComponent<Collider>();
            made.AddComponent<Renderer>();
            return made;
        }
        internal IEnumerable<Behaviour> Behaviours => parts.OfType<MonoBehaviour>().ToArray();
        internal void Drop(Component part) { parts.Remove(part); }
        internal void Remove()
        {
            foreach (GameObject each in Below().ToArray()) { each.gone = true; each.Settle(); Stage.Remove(each); }
            transform.Detach();
        }
        internal GameObject Copy()
        {
            var made = new GameObject(name) { active = active };
            foreach (Component part in parts.Where(part => !(part is Transform)))
            {
                Component twin = made.Add(part.GetType());
                foreach (FieldInfo field in part.GetType().GetFields()) field.SetValue(twin, field.GetValue(part));
            }
            made.transform.localPosition = transform.localPosition;
            made.transform.localRotation = transform.localRotation;
            made.transform.localScale = transform.localScale;
            for (int k = 0; k < transform.childCount; k++)
            {
                transform.GetChild(k).gameObject.Copy().transform.SetParent(made.transform, false);
            }
            return made;
        }
        /// <summary>Send Awake, OnEnable, OnDisable as they are due.</summary>
        internal void Settle()
        {
            foreach (GameObject each in Below().ToArray())
            {
                foreach (Behaviour part in each.Behaviours)
                {
                    if (!part.Woken && each.activeInHierarchy) { part.Woken = true; Stage.Send(part, "Awake"); }
                    bool on = part.Woken && part.enabled && each.activeInHierarchy;
                    if (on != part.Told) { part.Told = on; Stage.Send(part, on ? "OnEnable" : "OnDisable"); }
                }
            }
        }
        private Component Add(Type type)
        {
            var part = (Component)Activator.CreateInstance(type);
            part.gameObject = this;
            parts.Add(part);
            if (transform != null) Settle();
            return part;
        }
        private IEnumerable<GameObject> Below()
        {
            yield return this;
            for (int k = 0; k < transform.childCount; k++)
                foreach (GameObject each in transform.GetChild(k).gameObject.Below()) yield return each;
        }
    }

    /// <summary>The stub's own: all objects, and their frames.</summary>
    public static class Stage
    {
        private static readonly List<GameObject> All = new List<GameObject>();
        internal static void Add(GameObject made) { All.Add(made); }
        internal static void Remove(GameObject gone) { All.Remove(gone); }
        /// <summary>Start, Update, LateUpdate, in the components' order of execution.</summary>
        public static void Frame()
        {
            foreach (string message in new[] { "Start", "Update", "LateUpdate" })
            {
                Behaviour[] due = All.SelectMany(each => each.Behaviours).Where(part => part.Told).OrderBy(Order).ToArray();
                foreach (Behaviour part in due)
                {
                    if (!part.Told || (message == "Start" && part.Started)) continue;
                    part.Started = true;
                    Send(part, message);
                }
            }
        }
        public static void Clear() { foreach (GameObject each in All.Where(each => each.transform.parent == null).ToArray()) each.Remove(); }
        internal static void Send(Behaviour part, string message)
        {
            MethodInfo method = part.GetType().GetMethod(message, BindingFlags.Instance | BindingFlags.NonPublic | BindingFlags.Public);
            if (method != null) method.Invoke(part, null);
        }
        private static int Order(Behaviour part)
        {
            return part.GetType().GetCustomAttributes(typeof(DefaultExecutionOrder), true).Cast<DefaultExecutionOrder>().Select(each => each.order).FirstOrDefault();
        }
    }

    public static class Time { public static float time => (float)(DateTime.UtcNow - DateTime.UtcNow.Date).TotalSeconds; }

    public static class Debug
    {
        public static readonly List<string> Said = new List<string>(); // the stub's own
        public static void Log(object message, Object context = null) { Say("log", message); }
        public static void LogWarning(object message, Object context = null) { Say("warning", message); }
        public static void LogError(object message, Object context = null) { Say("error", message); }
        private static void Say(string kind, object message) { lock (Said) Said.Add(kind + ": " + message); }
    }

    [AttributeUsage(AttributeTargets.Class)] public sealed class AddComponentMenu : Attribute { public AddComponentMenu(string menuName) { } }
    [AttributeUsage(AttributeTargets.Class)] public sealed class DisallowMultipleComponent : Attribute { }
    [AttributeUsage(AttributeTargets.Class)] public sealed class DefaultExecutionOrder : Attribute
    {
        public DefaultExecutionOrder(int order) { this.order = order; }
        public int order { get; }
    }
    [AttributeUsage(AttributeTargets.Field)] public sealed class TooltipAttribute : Attribute { public TooltipAttribute(string tooltip) { } }
    [AttributeUsage(AttributeTargets.Field)] public sealed class RangeAttribute : Attribute { public RangeAttribute(float min, float max) { } }
}
