// STUBS, for checking only: as much of UnityEditor as the package's inspector uses.
using System;

namespace UnityEditor
{
    public enum MessageType { None, Info, Warning, Error }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class CustomEditor : Attribute { public CustomEditor(Type inspectedType) { } }

    public class Editor : UnityEngine.Object
    {
        public UnityEngine.Object target { get; set; }
        public virtual void OnInspectorGUI() { }
        public bool DrawDefaultInspector() => false;
    }

    public static class EditorGUI
    {
        public static void BeginChangeCheck() { }
        public static bool EndChangeCheck() => false;
    }

    public static class EditorGUILayout
    {
        public static void Space() { }
        public static void HelpBox(string message, MessageType type) { }
        public static bool Foldout(bool foldout, string content) => foldout;
        public static void LabelField(string label, string label2) { }
    }
}
