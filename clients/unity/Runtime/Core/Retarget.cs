using System;
using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>
    /// Turns frames of an agent into poses of a character of any skeleton: clients/README.md, "Retargeting". Nothing here
    /// knows the axes of the character's bones: its T-pose follows from the places of its joints.
    /// </summary>
    public sealed class Retarget
    {
        private const double Reach = 0.999; // of a leg's length: how far it is stretched at most
        private const double Sinks = 0.018; // of a leg's length: how far hips sink at most for a standing foot to reach its print

        // heights of a sole over the ground by the leg's length: hips sink and a heel rises by all that a foot lacks while
        // it is below the first, by nothing when it is above the second
        private const double Stands = 0.02, Leaves = 0.06;
        private const double Tiptoe = 0.25; // radians: how far a heel rises at most for a foot to reach its print
        private const double Flex = 0.5; // radians: how far toes turn up at most where a shoe is longer than the agent's foot
        private const double Bend = 0.1; // of the thigh's length: a knee that bends less than this bends forwards

        // places in the scratch array: of vectors, then of numbers
        private const int Ahead = 0, Beside = 3, Goals = 6, Along = 12, Side = 15, Front = 18, From = 21, To = 24, Ball = 27,
            Turn = 30, More = 34; // Goals: one a leg

        private readonly RetargetRest rest;
        private readonly int[] mapped;
        private readonly double[] up;
        private readonly double[] forward;
        private readonly double[] left;
        private readonly double[] rotations = new double[4 * Bones.Count];
        private readonly double[] places = new double[3 * Bones.Count];
        private readonly double[] local = new double[4 * Bones.Count];
        private readonly double[] hips = new double[3];
        private readonly double[] moved = new double[3 * Bones.Count];
        private readonly double[] turns = new double[4 * Bones.Count]; // of the agent, in the world
        private readonly double[] source = new double[3 * Bones.Count];
        private readonly double[] scratch = new double[More + 3];
        private readonly double[] clear = new double[2]; // height of each of the agent's soles
        private readonly double[] reaches = new double[2]; // how far each ankle may be from its thigh joint
        private readonly double[] stays = new double[2]; // 1 for a foot on the ground, 0 for one that has left it

        /// <param name="boneMap">Which node of the character is which bone.</param>
        /// <param name="restOffsets">Of the agent, three numbers a bone, in the stream's basis and unit.</param>
        /// <param name="basis">Of the stream, and of the character's own space.</param>
        /// <param name="floor">Height of the character's soles at rest; NaN: 0, or below its feet where they are not near 0.</param>
        /// <param name="soles">The soles found in the character's mesh, or null.</param>
        /// <exception cref="ArgumentException">Rest offsets are lacking.</exception>
        public Retarget(
            BoneMap boneMap, IReadOnlyList<double> restOffsets, Basis basis, double floor = double.NaN, Soles soles = null)
        {
            Map = boneMap;
            Basis = basis;
            rest = new RetargetRest(boneMap, restOffsets, basis, floor, soles);
            mapped = rest.Mapped;
            up = basis.UpAxis;
            forward = basis.ForwardAxis;
            left = basis.LeftAxis;
        }

        public BoneMap Map { get; }

        public Basis Basis { get; }

        /// <summary>Numbers of the bones that the character has, parents first.</summary>
        public IReadOnlyList<int> Mapped => mapped;

        /// <summary>Bones whose places must be set, too: the hips, and bones that hang from another bone than they follow.</summary>
        public IReadOnlyList<int> Loose => rest.Loose;

        /// <summary>Places of the loose bones' nodes relative to their parents: x, y, z a bone.</summary>
        public double[] Moved => moved;

        /// <summary>Height of the character's thigh joints by that of the agent's.</summary>
        public double Ratio => rest.Ratio;

        /// <summary>Height of the ground below the last pose.</summary>
        public double Ground { get; private set; }

        /// <summary>Rotations of the bones' nodes in the world: x, y, z, w per bone.</summary>
        public double[] Rotations => rotations;

        /// <summary>Places of the bones' nodes in the world: x, y, z per bone.</summary>
        public double[] Places => places;

        /// <summary>Rotations relative to the nodes' parents: x, y, z, w a bone.</summary>
        public double[] Local => local;

        /// <summary>Place of the hips' node relative to its parent.</summary>
        public double[] Hips => hips;

        /// <summary>Node of a bone, -1 if the character lacks it.</summary>
        public int Node(int bone)
        {
            return rest.Nodes[bone];
        }

        /// <summary>
        /// A frame of the stream (hips x, y, z, then x, y, z, w of the 22 bones and any more) on the character: fills
        /// rotations, places, local, moved and hips. Allocates nothing.
        /// </summary>
        /// <param name="frame">A PlayedAgent's, of the profile body or full.</param>
        /// <param name="ground">Height of the ground there; NaN: that of the lower sole.</param>
        public void Pose(float[] frame, double ground = double.NaN)
        {
            FindAgent(frame);
            for (int leg = 0; leg < 2; leg++)
            {
                int ankle = 3 * RetargetRest.Legs[leg][2];
                double low = Lowest(rest.SourceSoles[leg], leg);
                clear[leg] = low + source[ankle] * up[0] + source[ankle + 1] * up[1] + source[ankle + 2] * up[2];
                FlexToes(leg, low);
            }
            if (double.IsNaN(ground))
            {
                ground = Math.Min(clear[0], clear[1]);
            }
            Ground = ground;
            for (int n = 0; n < mapped.Length; n++)
            {
                int b = 4 * mapped[n];
                Quaternions.Multiply(turns, b, rest.Rotations, b, rotations, b);
            }
            double[] s = scratch;
            int leftThigh = 3 * RetargetRest.Legs[0][0], rightThigh = 3 * RetargetRest.Legs[1][0];
            for (int n = 0; n < 3; n++)
            {
                s[From + n] = (source[leftThigh + n] + source[rightThigh + n]) / 2;
            }
            double high = High(From);
            double lift = ground + (high - ground) * rest.Ratio - high;
            Quaternions.Rotate(rotations, 0, rest.Thighs, 0, s, To);
            for (int n = 0; n < 3; n++)
            {
                places[n] = s[From + n] + lift * up[n] - s[To + n];
            }
            Put();
            double sunk = 0;
            for (int leg = 0; leg < 2; leg++)
            {
                double lifted = Math.Max(0, clear[leg] - ground) * rest.Ratio;
                FindGoal(leg, ground + lifted);
                reaches[leg] = FindReach(leg);
                stays[leg] = Math.Min(1, Math.Max(0, (Leaves - lifted / rest.Lengths[leg]) / (Leaves - Stands)));
                sunk = Math.Max(sunk, Lacks(leg));
            }
            for (int n = 0; n < mapped.Length; n++)
            {
                for (int k = 0; k < 3; k++)
                {
                    places[3 * mapped[n] + k] -= sunk * up[k];
                }
            }
            for (int leg = 0; leg < 2; leg++)
            {
                RaiseHeel(leg);
                BendLeg(leg);
            }
            Put();
            Relate();
        }

        /// <summary>Rotations and places of the agent's bones in the world.</summary>
        private void FindAgent(float[] frame)
        {
            for (int n = 0; n < 3; n++)
            {
                source[n] = frame[n];
            }
            for (int b = 0; b < Bones.Count; b++)
            {
                int at = 3 + 4 * b, to = 4 * b, parent = Bones.Parent(b);
                double x = frame[at], y = frame[at + 1], z = frame[at + 2], w = frame[at + 3];
                double length = Math.Sqrt(x * x + y * y + z * z + w * w);
                turns[to] = x / length;
                turns[to + 1] = y / length;
                turns[to + 2] = z / length;
                turns[to + 3] = w / length;
                if (parent < 0)
                {
                    continue;
                }
                Quaternions.Multiply(turns, 4 * parent, turns, to, turns, to);
                Quaternions.Rotate(turns, 4 * parent, rest.SourceOffsets, 3 * b, source, 3 * b);
                for (int n = 0; n < 3; n++)
                {
                    source[3 * b + n] += source[3 * parent + n];
                }
            }
        }

        /// <summary>Height of the lowest point of a foot over its ankle; Ball: the ball from the ankle.</summary>
        private double Lowest(RetargetRest.Sole sole, int leg)
        {
            double[] s = scratch;
            int ankle = 4 * RetargetRest.Legs[leg][2], toe = 4 * RetargetRest.Legs[leg][3];
            Quaternions.Rotate(turns, ankle, sole.Ball, 0, s, Ball);
            Quaternions.Rotate(turns, ankle, sole.Joint, 0, s, From);
            double joint = High(From), low = double.PositiveInfinity;
            Quaternions.RotateBack(turns, ankle, up, 0, s, From);
            for (int k = 0; k < sole.Fixed.Length; k += 3)
            {
                low = Math.Min(low, Along3(sole.Fixed, k));
            }
            Quaternions.RotateBack(turns, toe, up, 0, s, From);
            for (int k = 0; k < sole.Toes.Length; k += 3)
            {
                low = Math.Min(low, joint + Along3(sole.Toes, k));
            }
            return low;
        }

        /// <summary>Of a point, how far it lies along From.</summary>
        private double Along3(double[] points, int k)
        {
            double[] s = scratch;
            return s[From] * points[k] + s[From + 1] * points[k + 1] + s[From + 2] * points[k + 2];
        }

        /// <summary>Places of the bones below the hips.</summary>
        private void Put()
        {
            for (int n = 1; n < mapped.Length; n++)
            {
                int b = mapped[n], a = rest.Above[b];
                Quaternions.Rotate(rotations, 4 * a, rest.Offsets, 3 * b, places, 3 * b);
                for (int k = 0; k < 3; k++)
                {
                    places[3 * b + k] += places[3 * a + k];
                }
            }
        }

        /// <summary>
        /// Turn up the toes of a long shoe, so that the ankle is as high over where it stands as the agent's, scaled.
        /// agentsLow: the agent's lowest point from its ankle.
        /// </summary>
        private void FlexToes(int leg, double agentsLow)
        {
            double[] s = scratch;
            RetargetRest.Sole sole = rest.Soles[leg];
            int ankle = 4 * RetargetRest.Legs[leg][2], toe = 4 * RetargetRest.Legs[leg][3];
            Quaternions.Rotate(turns, ankle, left, 0, s, Ahead); // the axis
            Without(Ahead, up, 0);
            double length = Size(Ahead);
            if (rest.Nodes[RetargetRest.Legs[leg][3]] < 0 || sole.Toes.Length == 0 || length < 0.1)
            {
                return;
            }
            Quaternions.Rotate(turns, ankle, sole.Joint, 0, s, From);
            Quaternions.Rotate(turns, toe, rest.Tips[leg], 0, s, To);
            double deep = rest.Ratio * agentsLow - High(From), high = High(To);
            for (int n = 0; n < 3; n++)
            {
                deep -= (rest.Ratio * rest.SourceSoles[leg].Ball[n] - sole.Ball[n]) * up[n];
                s[Ahead + n] /= -Basis.Handed * length;
            }
            s[Side] = s[Ahead + 1] * s[To + 2] - s[Ahead + 2] * s[To + 1]; // which way the tip goes
            s[Side + 1] = s[Ahead + 2] * s[To] - s[Ahead] * s[To + 2];
            s[Side + 2] = s[Ahead] * s[To + 1] - s[Ahead + 1] * s[To];
            double rises = High(Side);
            double share = Math.Min(0, deep) / Math.Max(Math.Sqrt(high * high + rises * rises), 1e-9);
            double angle = Math.Asin(Math.Max(-1, share)) - Math.Atan2(high, rises);
            double half = Math.Min(Flex, Math.Max(0, angle)) / 2, sine = Math.Sin(half);
            for (int n = 0; n < 3; n++)
            {
                s[Turn + n] = sine * s[Ahead + n];
            }
            s[Turn + 3] = Math.Cos(half);
            Quaternions.Multiply(s, Turn, turns, toe, turns, toe);
        }

        /// <summary>
        /// How far an ankle may be from its thigh joint: as straight as the agent's leg is, and beyond that a
        /// smoothly decreasing part of what the goal asks for.
        /// </summary>
        private double FindReach(int leg)
        {
            int start = 3 * RetargetRest.Legs[leg][0], end = 3 * RetargetRest.Legs[leg][2];
            double agents = Gap(source, end, source, start) / rest.SourceLengths[leg];
            double over = Gap(scratch, Goals + 3 * leg, places, start) / rest.Lengths[leg] - agents;
            double room = Math.Max(Reach - agents, 1e-6);
            double soft = agents + room * (1 - Math.Exp(-Math.Max(0, over) / room));
            return Math.Min(Reach, soft) * rest.Lengths[leg];
        }

        /// <summary>How far the hips must sink for a foot to reach its print.</summary>
        private double Lacks(int leg)
        {
            double[] s = scratch;
            int start = 3 * RetargetRest.Legs[leg][0];
            double length = rest.Lengths[leg], most = reaches[leg];
            for (int n = 0; n < 3; n++)
            {
                s[Side + n] = places[start + n] - s[Goals + 3 * leg + n];
            }
            double down = High(Side);
            Without(Side, up, 0);
            double away = Size(Side);
            double lacking = down - Math.Sqrt(Math.Max(0, most * most - away * away));
            return Math.Min(Sinks * length, Math.Max(0, lacking) * stays[leg]);
        }

        /// <summary>
        /// Lift the heel so far that the leg reaches its goal: the foot turns about its ball, as far as the ball bears it.
        /// </summary>
        private void RaiseHeel(int leg)
        {
            double[] s = scratch;
            RetargetRest.Sole sole = rest.Soles[leg];
            int start = 3 * RetargetRest.Legs[leg][0], ankle = RetargetRest.Legs[leg][2], goal = Goals + 3 * leg;
            double most = reaches[leg];
            Quaternions.Rotate(turns, 4 * ankle, sole.Heel, 0, s, From);
            Quaternions.Rotate(turns, 4 * ankle, sole.Ball, 0, s, Ball);
            Quaternions.Rotate(turns, 4 * ankle, left, 0, s, Ahead); // the axis
            Without(Ahead, up, 0);
            double length = Size(Ahead), along = 0;
            for (int n = 0; n < 3; n++)
            {
                s[Ahead + n] /= length;
                along += s[Ahead + n] * s[Ball + n];
            }
            s[Side] = s[Ball + 1] * s[Ahead + 2] - s[Ball + 2] * s[Ahead + 1]; // which way the ankle goes
            s[Side + 1] = s[Ball + 2] * s[Ahead] - s[Ball] * s[Ahead + 2];
            s[Side + 2] = s[Ball] * s[Ahead + 1] - s[Ball + 1] * s[Ahead];
            double sign = High(Side) < 0 ? -1 : 1, near = 0, ahead = 0, beside = 0, square = 0;
            for (int n = 0; n < 3; n++)
            {
                double ball = s[Ball + n], aside = along * s[Ahead + n];
                double thigh = places[start + n] - s[goal + n] - ball; // from the ball
                near += thigh * (aside - ball);
                ahead += sign * thigh * s[Side + n];
                beside += thigh * aside;
                square += thigh * thigh + ball * ball;
            }
            double wanted = (square - most * most) / 2 + beside;
            double share = wanted / Math.Max(Math.Sqrt(near * near + ahead * ahead), 1e-9);
            double lacking = Math.Atan2(ahead, near) - Math.Acos(Math.Min(1, Math.Max(-1, share)));
            double bears = Math.Min(1, Math.Max(0, 1 - (High(Ball) - High(From)) / (Stands * rest.Lengths[leg])));
            double half = stays[leg] * bears * Math.Min(Tiptoe, Math.Max(0, lacking)) / 2, sine = sign * Math.Sin(half);
            for (int n = 0; n < 3; n++)
            {
                s[Turn + n] = sine * s[Ahead + n];
            }
            s[Turn + 3] = Math.Cos(half);
            Quaternions.Multiply(s, Turn, rotations, 4 * ankle, rotations, 4 * ankle);
            Quaternions.Rotate(s, Turn, s, Ball, s, To);
            for (int n = 0; n < 3; n++)
            {
                s[goal + n] += s[Ball + n] - s[To + n];
            }
        }

        /// <summary>Turn thigh and shin so that the ankle is at its goal, or as near as the leg reaches.</summary>
        private void BendLeg(int leg)
        {
            double[] s = scratch;
            int[] bones = RetargetRest.Legs[leg];
            int hip = bones[0], knee = bones[1], ankle = bones[2], goal = Goals + 3 * leg;
            int start = 3 * hip, bend = 3 * knee, end = 3 * ankle;
            double thigh = Gap(places, bend, places, start);
            double shin = Gap(places, end, places, bend);
            Limit(start, goal, reaches[leg], 1.001 * Math.Abs(thigh - shin));
            double far = Gap(s, goal, places, start);
            for (int n = 0; n < 3; n++)
            {
                s[Along + n] = (s[goal + n] - places[start + n]) / far;
                s[Side + n] = places[bend + n] - places[start + n];
            }
            Without(Side, s, Along);
            Quaternions.Rotate(turns, 4 * hip, forward, 0, s, Front);
            Without(Front, s, Along);
            double length = Math.Max(Size(Front), 1e-6), bent = 0;
            for (int n = 0; n < 3; n++)
            {
                s[Front + n] /= length;
                bent += s[Side + n] * s[Front + n];
            }
            double lacking = Math.Max(0, Bend * thigh - bent);
            for (int n = 0; n < 3; n++)
            {
                s[Side + n] += lacking * s[Front + n];
            }
            double wide = Math.Max(Size(Side), 1e-9);
            double reach = (thigh * thigh + far * far - shin * shin) / (2 * far);
            double aside = Math.Sqrt(Math.Max(0, thigh * thigh - reach * reach)) / wide;
            for (int n = 0; n < 3; n++)
            {
                s[From + n] = places[bend + n] - places[start + n];
                s[To + n] = reach * s[Along + n] + aside * s[Side + n]; // the knee from the hip
                s[More + n] = places[end + n] - places[bend + n];
                s[goal + n] -= places[start + n] + s[To + n]; // the foot from the knee
            }
            Quaternions.Arc(s, From, s, To, s, Turn);
            Quaternions.Multiply(s, Turn, rotations, 4 * hip, rotations, 4 * hip);
            Quaternions.Arc(s, More, s, goal, s, Turn);
            Quaternions.Multiply(s, Turn, rotations, 4 * knee, rotations, 4 * knee);
        }

        /// <summary>
        /// Goals: where the ankle goes: the ball over the same point as the agent's, the sole at a height.
        /// </summary>
        private void FindGoal(int leg, double soleHeight)
        {
            double[] s = scratch;
            int ankle = RetargetRest.Legs[leg][2], goal = Goals + 3 * leg;
            Quaternions.Rotate(turns, 4 * ankle, forward, 0, s, Ahead);
            Without(Ahead, up, 0);
            if (Size(Ahead) < 0.1) // it points straight down
            {
                Quaternions.Rotate(turns, 0, forward, 0, s, Ahead);
                Without(Ahead, up, 0);
            }
            Quaternions.Arc(forward, 0, s, Ahead, s, Turn);
            Quaternions.Rotate(s, Turn, rest.Stance[leg], 0, s, Beside);
            Quaternions.Rotate(turns, 4 * ankle, rest.SourceSoles[leg].Ball, 0, s, goal);
            double low = Lowest(rest.Soles[leg], leg);
            for (int n = 0; n < 3; n++)
            {
                s[goal + n] += source[3 * ankle + n] + s[Beside + n] - s[Ball + n];
            }
            Without(goal, up, 0);
            for (int n = 0; n < 3; n++)
            {
                s[goal + n] += (soleHeight - low) * up[n];
            }
        }

        /// <summary>Bring a goal to where the leg reaches: at its height, if it can, nearer to the hip.</summary>
        private void Limit(int start, int goal, double most, double least)
        {
            double[] s = scratch;
            for (int n = 0; n < 3; n++)
            {
                s[Side + n] = s[goal + n] - places[start + n];
            }
            double down = High(Side);
            Without(Side, up, 0);
            double wide = Size(Side);
            double far = Math.Sqrt(down * down + wide * wide);
            double share;
            if (far > most)
            {
                down = Math.Max(-most, Math.Min(most, down));
                share = Math.Sqrt(most * most - down * down) / Math.Max(wide, 1e-9);
            }
            else if (far < least)
            {
                down = -least;
                share = 0;
            }
            else
            {
                return;
            }
            for (int n = 0; n < 3; n++)
            {
                s[goal + n] = places[start + n] + share * s[Side + n] + down * up[n];
            }
        }

        /// <summary>Rotations relative to the nodes' parents, and places of loose bones.</summary>
        private void Relate()
        {
            double[] s = scratch;
            for (int n = 0; n < mapped.Length; n++)
            {
                int b = 4 * mapped[n];
                TurnParent(mapped[n]);
                Quaternions.Relative(s, Turn, rotations, b, local, b);
            }
            for (int n = 0; n < rest.Loose.Length; n++)
            {
                int b = rest.Loose[n], a = rest.Hangs[b];
                TurnParent(b);
                for (int k = 0; k < 3; k++)
                {
                    s[To + k] = rest.ParentPlaces[3 * b + k];
                }
                if (a >= 0)
                {
                    Quaternions.Rotate(rotations, 4 * a, rest.ParentPlaces, 3 * b, s, To);
                }
                for (int k = 0; k < 3; k++)
                {
                    s[From + k] = places[3 * b + k] - s[To + k] - (a < 0 ? 0 : places[3 * a + k]);
                }
                Quaternions.RotateBack(s, Turn, s, From, moved, 3 * b);
                for (int k = 0; k < 3; k++)
                {
                    moved[3 * b + k] /= rest.ParentScales[3 * b + k];
                }
            }
            for (int n = 0; n < 3; n++)
            {
                hips[n] = moved[n];
            }
        }

        /// <summary>Turn: rotation in the world of the parent of a bone's node.</summary>
        private void TurnParent(int bone)
        {
            double[] s = scratch;
            int a = rest.Hangs[bone];
            if (a >= 0)
            {
                Quaternions.Multiply(rotations, 4 * a, rest.ParentTurns, 4 * bone, s, Turn);
                return;
            }
            for (int k = 0; k < 4; k++)
            {
                s[Turn + k] = rest.ParentTurns[4 * bone + k];
            }
        }

        /// <summary>Height of a vector of the scratch.</summary>
        private double High(int at)
        {
            return scratch[at] * up[0] + scratch[at + 1] * up[1] + scratch[at + 2] * up[2];
        }

        /// <summary>Take out of a vector of the scratch what lies along a unit vector.</summary>
        private void Without(int at, double[] unit, int j)
        {
            double[] s = scratch;
            double along = s[at] * unit[j] + s[at + 1] * unit[j + 1] + s[at + 2] * unit[j + 2];
            for (int n = 0; n < 3; n++)
            {
                s[at + n] -= along * unit[j + n];
            }
        }

        private double Size(int at)
        {
            double[] s = scratch;
            return Math.Sqrt(s[at] * s[at] + s[at + 1] * s[at + 1] + s[at + 2] * s[at + 2]);
        }

        private static double Gap(double[] a, int i, double[] b, int j)
        {
            double x = a[i] - b[j], y = a[i + 1] - b[j + 1], z = a[i + 2] - b[j + 2];
            return Math.Sqrt(x * x + y * y + z * z);
        }
    }
}
