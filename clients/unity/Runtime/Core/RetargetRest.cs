using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>
    /// A character and an agent at rest: the character's T-pose, from the places of its joints, and how their legs and
    /// feet compare. What <see cref="Retarget"/> works out once.
    /// </summary>
    internal sealed class RetargetRest
    {
        /// <summary>Hip, knee, ankle, foot of the left and of the right leg.</summary>
        internal static readonly int[][] Legs = Limbs("hip", "knee", "ankle", "foot");

        private static readonly int[][] Arms = Limbs("shoulder", "elbow", "wrist");
        private const double Heel = 0.35; // of the way from ankle to ball: how far the heel is behind the ankle
        private const double Tip = 0.45; // of the way from ankle to ball: how far the tip of the toes is before the ball

        /// <summary>Node of each bone, or -1.</summary>
        public readonly int[] Nodes;

        /// <summary>Bones that there are, parents first.</summary>
        public readonly int[] Mapped;

        /// <summary>The bone above, of those that there are, or -1.</summary>
        public readonly int[] Above = new int[Bones.Count];

        /// <summary>Of each node in the T-pose.</summary>
        public readonly double[] Rotations = new double[4 * Bones.Count];

        /// <summary>Of each bone, in the axes of the one above.</summary>
        public readonly double[] Offsets = new double[3 * Bones.Count];

        /// <summary>Rest rotation of the node's parent, in the axes of the bone above.</summary>
        public readonly double[] Gaps = new double[4 * Bones.Count];

        /// <summary>Of the agent.</summary>
        public readonly double[] SourceOffsets = new double[3 * Bones.Count];

        /// <summary>What the hips' node hangs from.</summary>
        public readonly double[] BaseTurn, BasePlace, BaseScale;

        /// <summary>Of feet that stand: heel and ball from the ankle, tip of the toes from the ball.</summary>
        public readonly double[][] Soles = { new double[9], new double[9] };

        public readonly double[][] SourceSoles = { new double[9], new double[9] };

        /// <summary>How far the balls stand beside the agent's.</summary>
        public readonly double[][] Stance = new double[2][];

        /// <summary>The middle of the thigh joints from the hips' node, in its axes.</summary>
        public readonly double[] Thighs = new double[3];

        /// <summary>Height of the character's thigh joints by that of the agent's.</summary>
        public readonly double Ratio;

        private readonly Rig rig;
        private readonly Basis basis;
        private readonly CharacterJoints joints;
        private readonly double[][] place = new double[Bones.Count][]; // of each bone at rest, in the basis; null: not there
        private readonly double[][] correct = new double[Bones.Count][]; // what turns it into the T-pose

        public RetargetRest(BoneMap map, IReadOnlyList<double> restOffsets, Basis basis, double floor)
        {
            rig = map.Rig;
            this.basis = basis;
            Nodes = Bones.Names.Select(map.Node).ToArray();
            Mapped = Enumerable.Range(0, Bones.Count).Where(b => Nodes[b] >= 0).ToArray();
            for (int k = 0; k < SourceOffsets.Length; k++)
            {
                SourceOffsets[k] = k < restOffsets.Count ? restOffsets[k] : double.NaN;
            }
            if (SourceOffsets.Any(double.IsNaN))
            {
                throw new ArgumentException("rest offsets of " + Bones.Count + " bones are needed");
            }
            var rotation = new double[Bones.Count][];
            joints = new CharacterJoints(map, basis);
            foreach (int b in Mapped)
            {
                List<int> ancestors = rig.Ancestors(Nodes[b]);
                Above[b] = Array.IndexOf(Nodes, ancestors.Where(Nodes.Contains).DefaultIfEmpty(-2).First());
                rotation[b] = Product(joints.Turn, rig.Rotation(Nodes[b]));
                place[b] = joints.Place(b);
            }
            FindCorrections();
            foreach (int b in Mapped)
            {
                Product(correct[b], rotation[b]).CopyTo(Rotations, 4 * b);
                int a = Above[b];
                if (a < 0)
                {
                    continue;
                }
                Quaternions.RotateBack(rotation[a], 0, Vectors.Minus(place[b], place[a]), 0, Offsets, 3 * b);
                double[] over = rig.Rotation(rig.Parent(Nodes[b]));
                Quaternions.Relative(rig.Rotation(Nodes[a]), 0, over, 0, Gaps, 4 * b);
            }
            int parent = rig.Parent(Nodes[0]);
            BaseTurn = rig.Rotation(parent);
            BasePlace = rig.Place(parent);
            BaseScale = rig.Scale(parent);
            Quaternions.RotateBack(rotation[0], 0, Vectors.Minus(Middle(place), place[0]), 0, Thighs, 0);
            Ratio = FindLegs(floor);
        }

        /// <summary>What turns each bone from the character's rest pose into a T-pose.</summary>
        private void FindCorrections()
        {
            double[] down = Vectors.Times(-1, basis.UpAxis);
            var aims = new Dictionary<int, KeyValuePair<int, double[]>>();
            for (int s = 0; s < 2; s++)
            {
                double[] side = Vectors.Times(s == 0 ? 1 : -1, basis.LeftAxis);
                for (int n = 0; n < 2; n++)
                {
                    aims[Legs[s][n]] = new KeyValuePair<int, double[]>(Legs[s][n + 1], down);
                    aims[Arms[s][n]] = new KeyValuePair<int, double[]>(Arms[s][n + 1], side);
                }
            }
            foreach (int b in Mapped)
            {
                double[] turn = Above[b] < 0 ? new double[] { 0, 0, 0, 1 } : correct[Above[b]];
                KeyValuePair<int, double[]> aim;
                if (aims.TryGetValue(b, out aim) && place[aim.Key] != null)
                {
                    double[] limb = Turned(turn, Vectors.Minus(place[aim.Key], place[b]));
                    turn = Product(Least(limb, aim.Value), turn);
                }
                correct[b] = turn;
            }
            foreach (int[] leg in Legs) // soles stay level: feet only turn to the front
            {
                int ankle = leg[2], toe = leg[3];
                double[] ahead = place[toe] == null ? basis.ForwardAxis : Level(Vectors.Minus(place[toe], place[ankle]));
                correct[ankle] = Least(ahead, basis.ForwardAxis);
                if (place[toe] != null)
                {
                    correct[toe] = correct[ankle];
                }
            }
        }

        /// <summary>Soles, stance, and the ratio of heights.</summary>
        private double FindLegs(double floor)
        {
            double[] up = basis.UpAxis;
            var stand = new double[Bones.Count][]; // joint places in the T-pose
            stand[0] = place[0];
            foreach (int b in Mapped.Where(b => Above[b] >= 0))
            {
                int a = Above[b];
                stand[b] = Vectors.Plus(stand[a], Turned(correct[a], Vectors.Minus(place[b], place[a])));
            }
            var source = new double[Bones.Count][];
            for (int b = 0; b < Bones.Count; b++)
            {
                double[] offset = { SourceOffsets[3 * b], SourceOffsets[3 * b + 1], SourceOffsets[3 * b + 2] };
                source[b] = b == 0 ? offset : Vectors.Plus(source[Bones.Parent(b)], offset);
            }
            double legs = Legs.Sum(leg => Vectors.Dot(Vectors.Minus(stand[leg[0]], stand[leg[2]]), up));
            double scale = legs / Legs.Sum(leg => Vectors.Dot(Vectors.Minus(source[leg[0]], source[leg[2]]), up));
            if (double.IsNaN(floor))
            {
                double sole = Legs.SelectMany(leg => leg.Skip(2)).Min(b => Vectors.Dot(source[b], up));
                floor = double.IsNaN(joints.Floor) ? joints.Lowest - scale * sole : joints.Floor;
            }
            double[] thighs = Middle(stand), sourceThighs = Middle(source);
            double high = 0;
            for (int leg = 0; leg < 2; leg++)
            {
                int ankle = Legs[leg][2], toe = Legs[leg][3];
                double[] ball = Vectors.Minus(source[toe], source[ankle]);
                FillSole(ball, Vectors.Dot(source[ankle], up), SourceSoles[leg]);
                double[] own = place[toe] == null // without toes, where a foot of this size would have them
                    ? Vectors.Times(scale, ball)
                    : Turned(correct[ankle], Vectors.Minus(place[toe], place[ankle]));
                double height = Vectors.Dot(place[ankle], up) - floor;
                high += height / 2;
                FillSole(own, height, Soles[leg]);
                double[] beside = Vectors.Minus(
                    Vectors.Minus(Vectors.Plus(stand[ankle], own), thighs), Vectors.Minus(source[toe], sourceThighs));
                Stance[leg] = Vectors.Times(Vectors.Dot(beside, basis.LeftAxis), basis.LeftAxis);
            }
            return (legs / 2 + high) / Vectors.Dot(sourceThighs, up);
        }

        /// <summary>Of the thigh joints: where the pelvis is. A rig's hips joint lies anywhere around it.</summary>
        private static double[] Middle(double[][] at)
        {
            return Vectors.Times(0.5, Vectors.Plus(at[Legs[0][0]], at[Legs[1][0]]));
        }

        private void FillSole(double[] ball, double height, double[] sole)
        {
            double[] ahead = Level(ball), down = Vectors.Times(-height, basis.UpAxis);
            Vectors.Minus(down, Vectors.Times(Heel, ahead)).CopyTo(sole, 0);
            Vectors.Plus(down, ahead).CopyTo(sole, 3);
            Vectors.Times(Tip, ahead).CopyTo(sole, 6);
        }

        private double[] Level(double[] v)
        {
            return Vectors.Without(v, basis.UpAxis);
        }

        private static int[][] Limbs(params string[] bones)
        {
            return BoneMap.Sides.Select(
                side => bones.Select(bone => Bones.IndexOf(side + "_" + bone)).ToArray()).ToArray();
        }

        private static double[] Product(double[] p, double[] q)
        {
            var product = new double[4];
            Quaternions.Multiply(p, 0, q, 0, product, 0);
            return product;
        }

        private static double[] Turned(double[] q, double[] v)
        {
            var turned = new double[3];
            Quaternions.Rotate(q, 0, v, 0, turned, 0);
            return turned;
        }

        private static double[] Least(double[] a, double[] b)
        {
            var arc = new double[4];
            Quaternions.Arc(a, 0, b, 0, arc, 0);
            return arc;
        }
    }
}
