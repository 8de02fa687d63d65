using System;
using System.Collections.Generic;
using System.Linq;
using UnityEngine;

namespace Wayfarer
{
    /// <summary>A choice of the user: the node of a bone.</summary>
    [Serializable]
    public struct BoneChoice
    {
        [Tooltip("Name of a bone: pelvis, left_hip, left_knee, left_ankle, left_foot, spine1 … (clients/README.md).")]
        public string bone;

        [Tooltip("Its node. None: the character lacks this bone.")]
        public Transform node;
    }

    /// <summary>
    /// A character's transforms at rest, as the core's Rig: Humanoid (by its avatar) or generic. Its own object is the
    /// uppermost node, taken to stand at the origin.
    /// </summary>
    public sealed class CharacterRig
    {
        private static readonly KeyValuePair<string, HumanBodyBones>[] Humanoid =
        {
            Pair("hips", HumanBodyBones.Hips), Pair("spine", HumanBodyBones.Spine), Pair("chest", HumanBodyBones.Chest),
            Pair("upperChest", HumanBodyBones.UpperChest), Pair("neck", HumanBodyBones.Neck), Pair("head", HumanBodyBones.Head),
            Pair("leftShoulder", HumanBodyBones.LeftShoulder), Pair("leftUpperArm", HumanBodyBones.LeftUpperArm),
            Pair("leftLowerArm", HumanBodyBones.LeftLowerArm), Pair("leftHand", HumanBodyBones.LeftHand),
            Pair("leftUpperLeg", HumanBodyBones.LeftUpperLeg), Pair("leftLowerLeg", HumanBodyBones.LeftLowerLeg),
            Pair("leftFoot", HumanBodyBones.LeftFoot), Pair("leftToes", HumanBodyBones.LeftToes),
            Pair("rightShoulder", HumanBodyBones.RightShoulder), Pair("rightUpperArm", HumanBodyBones.RightUpperArm),
            Pair("rightLowerArm", HumanBodyBones.RightLowerArm), Pair("rightHand", HumanBodyBones.RightHand),
            Pair("rightUpperLeg", HumanBodyBones.RightUpperLeg), Pair("rightLowerLeg", HumanBodyBones.RightLowerLeg),
            Pair("rightFoot", HumanBodyBones.RightFoot), Pair("rightToes", HumanBodyBones.RightToes),
        };

        private readonly List<Transform> nodes = new List<Transform>();
        private readonly List<RigNode> rest = new List<RigNode>();
        private readonly HashSet<Transform> skin;

        /// <param name="root">The character's object. Its bones stand as in its file: nothing has moved them yet.</param>
        /// <param name="animator">Its Animator, or null; one with a Humanoid avatar tells its bones.</param>
        /// <param name="choices">Corrections of the map that is found.</param>
        /// <exception cref="ArgumentException">It is no humanoid; the message says what is missing.</exception>
        public CharacterRig(Transform root, Animator animator, IEnumerable<BoneChoice> choices)
        {
            var humanoid = new Dictionary<string, Transform>();
            if (animator != null && animator.isHuman)
            {
                foreach (KeyValuePair<string, HumanBodyBones> pair in Humanoid)
                {
                    Transform bone = animator.GetBoneTransform(pair.Value);
                    if (bone != null)
                    {
                        humanoid[pair.Key] = bone;
                    }
                }
            }
            BoneChoice[] chosen = (choices ?? new BoneChoice[0]).ToArray();
            IEnumerable<Transform> skinned = root.GetComponentsInChildren<SkinnedMeshRenderer>(true)
                .SelectMany(renderer => renderer.bones).Where(bone => bone != null);
            skin = new HashSet<Transform>(skinned);
            if (skin.Count > 0)
            {
                skin.UnionWith(humanoid.Values);
                skin.UnionWith(chosen.Where(choice => choice.node != null).Select(choice => choice.node));
            }
            Collect(root, -1);
            Map = Find(humanoid.ToDictionary(pair => pair.Key, pair => nodes.IndexOf(pair.Value)), chosen);
        }

        public BoneMap Map { get; }

        /// <summary>Node of the map's number.</summary>
        public Transform Node(int number)
        {
            return nodes[number];
        }

        private BoneMap Find(Dictionary<string, int> humanoid, BoneChoice[] chosen)
        {
            var rig = new Rig(rest);
            var changes = new Dictionary<string, int>();
            foreach (BoneChoice choice in chosen)
            {
                int node = choice.node == null ? -1 : nodes.IndexOf(choice.node);
                if (choice.node != null && node < 0)
                {
                    throw new ArgumentException(choice.bone + ": " + choice.node.name + " is no node of this character");
                }
                changes[choice.bone] = node;
            }
            return BoneMap.Of(rig, humanoid, Basis.Unity, changes);
        }

        private void Collect(Transform node, int parent)
        {
            bool top = parent < 0;
            Vector3 place = top ? Vector3.zero : node.localPosition;
            Quaternion turn = top ? Quaternion.identity : node.localRotation;
            Vector3 scale = top ? node.lossyScale : node.localScale;
            int number = nodes.Count;
            nodes.Add(node);
            rest.Add(new RigNode
            {
                Name = node.name,
                Parent = parent,
                Position = new double[] { place.x, place.y, place.z },
                Rotation = new double[] { turn.x, turn.y, turn.z, turn.w },
                Scale = new double[] { scale.x, scale.y, scale.z },
            });
            for (int k = 0; k < node.childCount; k++)
            {
                if (HoldsBones(node.GetChild(k)))
                {
                    Collect(node.GetChild(k), number);
                }
            }
        }

        /// <summary>Bones, and what they hang from: a mesh may be called "Head", too.</summary>
        private bool HoldsBones(Transform node)
        {
            if (skin.Count == 0 || skin.Contains(node))
            {
                return true;
            }
            for (int k = 0; k < node.childCount; k++)
            {
                if (HoldsBones(node.GetChild(k)))
                {
                    return true;
                }
            }
            return false;
        }

        private static KeyValuePair<string, HumanBodyBones> Pair(string name, HumanBodyBones bone)
        {
            return new KeyValuePair<string, HumanBodyBones>(name, bone);
        }
    }
}
