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
        private const double Heel = 0.34; // of the way from ankle to ball: how far the heel is behind the ankle
        private const double Tip = 0.38; // of the way from ankle to ball: how far the tip of the toes is before the ball

        /// <summary>Node of each bone, or -1.</summary>
        public readonly int[] Nodes;

        /// <summary>Bones that there are, parents first.</summary>
        public readonly int[] Mapped;

        /// <summary>The existing bone that each bone follows, or -1.</summary>
        public readonly int[] Above = new int[Bones.Count];

        /// <summary>The bone that each one's node hangs from in the file, or -1.</summary>
        public readonly int[] Hangs = new int[Bones.Count];

        /// <summary>Bones whose places must be set, too: the hips, and bones that hang from another bone than they follow.</summary>
        public readonly int[] Loose;

        /// <summary>Of each node in the T-pose.</summary>
        public readonly double[] Rotations = new double[4 * Bones.Count];

        /// <summary>Of each bone, in the axes of the one above.</summary>
        public readonly double[] Offsets = new double[3 * Bones.Count];

        /// <summary>Of each node's parent, in the axes of the bone that it hangs from: rotation, place and scale.</summary>
        public readonly double[] ParentTurns = new double[4 * Bones.Count];

        public readonly double[] ParentPlaces = new double[3 * Bones.Count];
        public readonly double[] ParentScales = new double[3 * Bones.Count];

        /// <summary>Of the agent.</summary>
        public readonly double[] SourceOffsets = new double[3 * Bones.Count];

        /// <summary>Of feet in the T-pose.</summary>
        public readonly Sole[] Soles = new Sole[2];

        public readonly Sole[] SourceSoles = new Sole[2];

        /// <summary>Of each foot's toes, from their joint: as far before it and as low as they reach.</summary>
        public readonly double[][] Tips = { new double[3], new double[3] };

        /// <summary>Of the legs, from thigh joint to ankle along the bones: the character's, and the agent's.</summary>
        public readonly double[] Lengths = new double[2];

        public readonly double[] SourceLengths = new double[2];

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

        public RetargetRest(BoneMap map, IReadOnlyList<double> restOffsets, Basis basis, double floor, Soles soles)
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
                Hangs[b] = Array.IndexOf(Nodes, ancestors.Where(Nodes.Contains).DefaultIfEmpty(-2).First());
                Above[b] = Bones.Parent(b);
                while (Above[b] >= 0 && Nodes[Above[b]] < 0)
                {
                    Above[b] = Bones.Parent(Above[b]);
                }
                rotation[b] = Product(joints.Turn, rig.Rotation(Nodes[b]));
                place[b] = joints.Place(b);
            }
            Loose = Mapped.Where(b => b == 0 || Hangs[b] != Above[b]).ToArray();
            FindCorrections();
            foreach (int b in Mapped)
            {
                Product(correct[b], rotation[b]).CopyTo(Rotations, 4 * b);
                if (Above[b] >= 0)
                {
                    double[] way = Vectors.Minus(place[b], place[Above[b]]);
                    Quaternions.RotateBack(rotation[Above[b]], 0, way, 0, Offsets, 3 * b);
                }
                int parent = rig.Parent(Nodes[b]);
                double[] turned = rig.Rotation(parent), at = rig.Place(parent);
                if (Hangs[b] >= 0)
                {
                    double[] back = rig.Rotation(Nodes[Hangs[b]]);
                    Quaternions.Relative(back, 0, turned, 0, turned, 0);
                    Quaternions.RotateBack(back, 0, Vectors.Minus(at, rig.Place(Nodes[Hangs[b]])), 0, at, 0);
                }
                turned.CopyTo(ParentTurns, 4 * b);
                at.CopyTo(ParentPlaces, 3 * b);
                rig.Scale(parent).CopyTo(ParentScales, 3 * b);
            }
            Quaternions.RotateBack(rotation[0], 0, Vectors.Minus(Middle(place), place[0]), 0, Thighs, 0);
            Ratio = FindLegs(floor, soles);
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
        private double FindLegs(double floor, Soles soles)
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
            if (double.IsNaN(floor) && soles != null)
            {
                floor = soles.Floor;
            }
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
                SourceSoles[leg] = SoleOf(ball, Vectors.Dot(source[ankle], up));
                double[] own = place[toe] == null // without toes, where a foot of this size would have them
                    ? Vectors.Times(scale, ball)
                    : Turned(correct[ankle], Vectors.Minus(place[toe], place[ankle]));
                double height = Vectors.Dot(place[ankle], up) - floor;
                high += height / 2;
                Soles[leg] = SoleOf(own, height);
                if (soles != null)
                {
                    Soles[leg].Joint = own;
                    Soles[leg].Fixed = AllTurned(correct[ankle], soles.Fixed[leg]);
                    Soles[leg].Toes = place[toe] == null ? new double[0] : AllTurned(correct[ankle], soles.Toes[leg]);
                }
                double[] toes = Soles[leg].Toes;
                if (toes.Length > 0)
                {
                    var points = Enumerable.Range(0, toes.Length / 3).Select(k => toes.Skip(3 * k).Take(3).ToArray()).ToList();
                    double before = points.Max(point => Vectors.Dot(point, basis.ForwardAxis));
                    double low = points.Min(point => Vectors.Dot(point, up));
                    Tips[leg] = Vectors.Plus(Vectors.Times(before, basis.ForwardAxis), Vectors.Times(low, up));
                }
                foreach (int b in new[] { Legs[leg][1], ankle })
                {
                    Lengths[leg] += Length(Offsets, b);
                    SourceLengths[leg] += Length(SourceOffsets, b);
                }
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

        /// <summary>A foot of which only the joints are known: the toes' from the ankle, which is at this height.</summary>
        private Sole SoleOf(double[] toe, double height)
        {
            double[] ahead = Level(toe), down = Vectors.Times(-height, basis.UpAxis);
            double[] ball = Vectors.Plus(down, ahead), heel = Vectors.Minus(down, Vectors.Times(Heel, ahead));
            double[] under = Vectors.Minus(ball, toe), tip = Vectors.Plus(under, Vectors.Times(Tip, ahead));
            return new Sole
            {
                Ball = ball, Heel = heel, Joint = toe, Fixed = heel.Concat(ball).ToArray(), Toes = under.Concat(tip).ToArray(),
            };
        }

        private static double Length(double[] offsets, int b)
        {
            return Math.Sqrt(offsets.Skip(3 * b).Take(3).Sum(value => value * value));
        }

        private static double[] AllTurned(double[] turn, double[] points)
        {
            var turned = new double[points.Length];
            for (int k = 0; k < points.Length; k += 3)
            {
                Quaternions.Rotate(turn, 0, points, k, turned, k);
            }
            return turned;
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

        /// <summary>
        /// A foot relative to the ankle's joint. Ball and Heel are on the ground. Fixed turn with the ankle; Toes turn
        /// about Joint, and are relative to it. x, y, z each.
        /// </summary>
        internal sealed class Sole
        {
            public double[] Ball, Heel, Joint, Fixed, Toes;
        }
    }
}
