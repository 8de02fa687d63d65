using System.Collections.Generic;
using System.Linq;

namespace Wayfarer
{
    /// <summary>Bones of a table of VRM's names, or of Unity's Humanoid, which are the same.</summary>
    internal static class BonesByTable
    {
        private static readonly string[] SpineBones = { "spine1", "spine2", "spine3" };

        public static Dictionary<string, int> Find(IReadOnlyDictionary<string, int> humanoid)
        {
            var bones = new Dictionary<string, int>();
            foreach (KeyValuePair<string, string> entry in BoneNames.Vrm)
            {
                if (humanoid.ContainsKey(entry.Value))
                {
                    bones[entry.Key] = humanoid[entry.Value];
                }
            }
            List<int> chain = BoneNames.VrmSpine.Where(humanoid.ContainsKey).Select(name => humanoid[name]).ToList();
            SpreadSpine(chain, bones);
            return bones;
        }

        /// <summary>Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.</summary>
        public static void SpreadSpine(IReadOnlyList<int> chain, Dictionary<string, int> bones)
        {
            int count = chain.Count;
            if (count == 1)
            {
                bones["spine3"] = chain[0];
            }
            else if (count == 2)
            {
                bones["spine1"] = chain[0];
                bones["spine3"] = chain[1];
            }
            else if (count > 2)
            {
                for (int k = 0; k < 3; k++)
                {
                    bones[SpineBones[k]] = chain[(k * (count - 1) + 1) / 2];
                }
            }
        }
    }
}
