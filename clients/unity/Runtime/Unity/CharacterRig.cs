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

        /// <param name="root">The character's object. Its bones are put into the bind pose of their skin.</param>
        /// <param name="animator">Its Animator, or null; a Humanoid avatar gives its bones.</param>
        /// <param name="choices">Corrections of the found map.</param>
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
            Skin[] skins = root.GetComponentsInChildren<SkinnedMeshRenderer>(true).Where(HasSkin).Select(SkinOf).ToArray();
            RigNode[] bound = Skins.Bound(rest, skins);
            for (int k = 0; k < bound.Length; k++)
            {
                if (bound[k].Position != rest[k].Position) // another array: the node stands in another place
                {
                    Put(nodes[k], rest[k] = bound[k]);
                }
            }
            Map = Find(humanoid.ToDictionary(pair => pair.Key, pair => nodes.IndexOf(pair.Value)), chosen);
            var places = new List<double>();
            var movers = new List<int>();
            Skins.Points(rest, skins, places, movers);
            Soles = Soles.Measure(Map, places, movers, Basis.Unity);
        }

        public BoneMap Map { get; }

        /// <summary>Its soles, from its meshes; null: they have no feet, or cannot be read.</summary>
        public Soles Soles { get; }

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

        private static bool HasSkin(SkinnedMeshRenderer renderer)
        {
            Mesh mesh = renderer.sharedMesh;
            return mesh != null && mesh.isReadable && mesh.bindposes.Length == renderer.bones.Length;
        }

        private Skin SkinOf(SkinnedMeshRenderer renderer)
        {
            Mesh mesh = renderer.sharedMesh;
            double[] space = Skins.Local(rest[0]);
            var line = new List<Transform>();
            for (Transform k = renderer.transform; k != nodes[0] && k != null; k = k.parent)
            {
                line.Add(k);
            }
            for (int k = line.Count - 1; k >= 0; k--)
            {
                space = Skins.Product(space, Skins.Local(Read(line[k], -1, false)));
            }
            return new Skin
            {
                Joints = renderer.bones.Select(bone => bone == null ? -1 : nodes.IndexOf(bone)).ToArray(),
                Inverses = mesh.bindposes.Select(m => Enumerable.Range(0, 16).Select(k => (double)m[k]).ToArray()).ToArray(),
                Space = space,
                Vertices = mesh.vertices.SelectMany(v => new double[] { v.x, v.y, v.z }).ToArray(),
                Movers = mesh.boneWeights.Select(Heaviest).ToArray(),
            };
        }

        private static int Heaviest(BoneWeight weight)
        {
            float most = Math.Max(Math.Max(weight.weight0, weight.weight1), Math.Max(weight.weight2, weight.weight3));
            return most == weight.weight0 ? weight.boneIndex0
                : most == weight.weight1 ? weight.boneIndex1
                : most == weight.weight2 ? weight.boneIndex2 : weight.boneIndex3;
        }

        private static void Put(Transform node, RigNode own)
        {
            double[] p = own.Position, q = own.Rotation, s = own.Scale;
            node.localPosition = new Vector3((float)p[0], (float)p[1], (float)p[2]);
            node.localRotation = new Quaternion((float)q[0], (float)q[1], (float)q[2], (float)q[3]);
            node.localScale = new Vector3((float)s[0], (float)s[1], (float)s[2]);
        }

        private static RigNode Read(Transform node, int parent, bool top)
        {
            Vector3 place = top ? Vector3.zero : node.localPosition;
            Quaternion turn = top ? Quaternion.identity : node.localRotation;
            Vector3 scale = top ? node.lossyScale : node.localScale;
            return new RigNode
            {
                Name = node.name,
                Parent = parent,
                Position = new double[] { place.x, place.y, place.z },
                Rotation = new double[] { turn.x, turn.y, turn.z, turn.w },
                Scale = new double[] { scale.x, scale.y, scale.z },
            };
        }

        private void Collect(Transform node, int parent)
        {
            int number = nodes.Count;
            nodes.Add(node);
            rest.Add(Read(node, parent, parent < 0));
            for (int k = 0; k < node.childCount; k++)
            {
                if (HoldsBones(node.GetChild(k)))
                {
                    Collect(node.GetChild(k), number);
                }
            }
        }

        /// <summary>Bones and their ancestors: a mesh may be called "Head", too.</summary>
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
