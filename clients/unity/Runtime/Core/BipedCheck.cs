using System;
using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>Refuses animals, and sides that contradict each other: clients/README.md, "Bones of a character".</summary>
    internal static class BipedCheck
    {
        private const double Backward = 0.2; // cosine of the angle up to which toes may point backwards
        private const double Heels = 0.3; // greatest height of an ankle over its leg's lowest node, by the thigh's height
        private const string HindLegs = "legs as animals' hind legs, whose heels are off the ground, are not found by their "
            + "shape. Say which bones these are, by a correction";

        /// <exception cref="ArgumentException">It says why the rig is no biped.</exception>
        public static void Check(BoneMap map, Basis basis)
        {
            Rig rig = map.Rig;
            int[] hips = BoneMap.Sides.Select(side => map.Node(side + "_hip")).ToArray();
            int[] others = new BonesByShape(rig, basis).OtherLegs(map.Node("pelvis"), hips);
            if (others != null)
            {
                string legs = string.Join(", ", hips.Concat(others).Select(k => Quoted(rig, k)).ToArray());
                throw new ArgumentException("it has four legs (" + legs + "): only what walks on two can be animated");
            }
            int against = BonesByName.Contradicted(map);
            if (against >= 0)
            {
                throw new ArgumentException(
                    Quoted(rig, against) + " is on the other side than its name tells, by where the feet point: " + HindLegs);
            }
            double[] up = new double[3], toes = new double[3];
            foreach (string side in BoneMap.Sides)
            {
                double[] ankle = rig.Place(map.Node(side + "_ankle"));
                up = Vectors.Plus(up, Vectors.Minus(rig.Place(map.Node(side + "_hip")), ankle));
                if (map.Node(side + "_foot") >= 0)
                {
                    toes = Vectors.Plus(toes, Vectors.Minus(rig.Place(map.Node(side + "_foot")), ankle));
                }
            }
            for (int s = 0; s < 2; s++)
            {
                int ankle = map.Node(BoneMap.Sides[s] + "_ankle");
                double low = rig.Subtree(ankle).Min(k => Vectors.Dot(rig.Place(k), up));
                if (Vectors.Dot(rig.Place(ankle), up) - low > Heels * (Vectors.Dot(rig.Place(hips[s]), up) - low))
                {
                    throw new ArgumentException(Quoted(rig, ankle) + " is high above the ground for an ankle: " + HindLegs);
                }
            }
            double[] across = Vectors.Minus(rig.Place(hips[0]), rig.Place(hips[1]));
            double[] forward = Vectors.Times(basis.Handed, Vectors.Cross(across, up));
            if (Vectors.Dot(toes, forward) < -Backward * Vectors.Length(toes) * Vectors.Length(forward))
            {
                throw new ArgumentException(
                    "its toes point backwards: left and right are exchanged, or these are no feet (" + Quoted(rig, hips[0])
                    + " counts as left)");
            }
        }

        private static string Quoted(Rig rig, int node)
        {
            return "\"" + rig.Name(node) + "\"";
        }
    }
}
