using System;
using UnityEditor;
using UnityEngine;

namespace Wayfarer
{
    /// <summary>Shows the map of bones, so that it can be corrected before Play is pressed.</summary>
    [CustomEditor(typeof(WayfarerCharacter))]
    internal sealed class WayfarerCharacterEditor : Editor
    {
        private CharacterRig rig;
        private string problem = "";
        private bool open = true;

        public override void OnInspectorGUI()
        {
            EditorGUI.BeginChangeCheck();
            DrawDefaultInspector();
            if (EditorGUI.EndChangeCheck() || (rig == null && problem == ""))
            {
                Find();
            }
            EditorGUILayout.Space();
            if (problem != "")
            {
                EditorGUILayout.HelpBox(problem, MessageType.Error);
                return;
            }
            open = EditorGUILayout.Foldout(open, "Bones, found by " + rig.Map.FoundBy);
            if (!open)
            {
                return;
            }
            foreach (string bone in Bones.Names)
            {
                int node = rig.Map.Node(bone);
                EditorGUILayout.LabelField(bone, node < 0 ? "(none: its children take over its turns)" : rig.Node(node).name);
            }
        }

        private void Find()
        {
            var character = (WayfarerCharacter)target;
            rig = null;
            problem = "";
            try
            {
                var animator = character.GetComponentInChildren<Animator>();
                rig = new CharacterRig(character.transform, animator, character.corrections);
            }
            catch (ArgumentException error)
            {
                problem = error.Message;
            }
        }
    }
}
