using System;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Runtime.CompilerServices;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>The files of tests/golden, which a clone of the repository has (its README says what they hold).</summary>
    internal static class Golden
    {
        private static readonly string Folder = Path.GetFullPath(Path.Combine(Here(), "../../../../tests/golden"));

        public static byte[] Bytes(string name)
        {
            return File.ReadAllBytes(Path.Combine(Folder, name));
        }

        public static JObject Document(string name)
        {
            string path = Path.Combine(Folder, name);
            if (!File.Exists(path))
            {
                throw new IgnoreException("needs tests/golden: install the package from a clone (file:…/clients/unity)");
            }
            return JObject.Parse(File.ReadAllText(path));
        }

        public static byte[] Message(string name)
        {
            return FromHex((string)Document("messages.json")[name]);
        }

        public static byte[] FromHex(string text)
        {
            return Enumerable.Range(0, text.Length / 2).Select(k => Convert.ToByte(text.Substring(2 * k, 2), 16)).ToArray();
        }

        public static double[] Doubles(JToken token)
        {
            return token.Type == JTokenType.Array
                ? token.SelectMany(Doubles).ToArray()
                : new[] { (double)token };
        }

        public static float[] Floats(params JToken[] tokens)
        {
            return tokens.SelectMany(Doubles).Select(value => (float)value).ToArray();
        }

        public static IReadOnlyList<RigNode> Nodes(JToken nodes)
        {
            return nodes.Select(node => new RigNode
            {
                Name = (string)node["name"],
                Parent = (int)node["parent"],
                Position = Doubles(node["position"]),
                Rotation = Doubles(node["rotation"]),
                Scale = Doubles(node["scale"]),
            }).ToArray();
        }

        public static Dictionary<string, int> Humanoid(JToken table)
        {
            return table.Type == JTokenType.Null ? null : table.ToObject<Dictionary<string, int>>();
        }

        public static void Near(double found, double wanted, double within, string what)
        {
            Assert.That(found, Is.EqualTo(wanted).Within(within), what);
        }

        /// <summary>Rotations: q and -q are the same.</summary>
        public static void NearTurn(double[] found, double[] wanted, double within, string what)
        {
            double dot = 0;
            for (int k = 0; k < 4; k++)
            {
                dot += found[k] * wanted[k];
            }
            for (int k = 0; k < 4; k++)
            {
                Near(dot < 0 ? -found[k] : found[k], wanted[k], within, what);
            }
        }

        public static double[] Part(double[] from, int start, int length)
        {
            return from.Skip(start).Take(length).ToArray();
        }

        public static double[] Part(float[] from, int start, int length)
        {
            return from.Skip(start).Take(length).Select(value => (double)value).ToArray();
        }

        private static string Here([CallerFilePath] string path = "")
        {
            return Path.GetDirectoryName(path);
        }
    }
}
