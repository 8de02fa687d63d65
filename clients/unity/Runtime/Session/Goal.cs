using System.Linq;
using Newtonsoft.Json.Linq;

namespace Wayfarer
{
    /// <summary>A place in the session's basis, metres.</summary>
    public struct Place
    {
        public double X;
        public double Y;
        public double Z;

        public Place(double x, double y, double z)
        {
            X = x;
            Y = y;
            Z = z;
        }

        internal JObject Json()
        {
            return new JObject { ["x"] = X, ["y"] = Y, ["z"] = Z };
        }
    }

    /// <summary>
    /// A place to go to, in metres of the session's basis, and how: the fields of a goal of the API (docs/api.md,
    /// "Goals"), as in <c>new Goal(2, 0, 3) { Speed = 1.4, ["stop"] = false }</c>. The server chooses for fields that are
    /// absent or null, and refuses fields that it does not know.
    /// </summary>
    public sealed class Goal
    {
        private readonly JObject fields;

        public Goal(double x, double y, double z)
        {
            fields = new JObject { ["position"] = new Place(x, y, z).Json() };
        }

        /// <summary>Target speed on the way, 0.2 … 4 m/s.</summary>
        public double? Speed { get => (double?)this["speed"]; set => this["speed"] = value; }

        /// <summary>To face after stopping: in Unity's basis a yaw, clockwise from +Z seen from above, radians.</summary>
        public double? Heading { get => (double?)this["heading"]; set => this["heading"] = value; }

        /// <summary>Distance of the hips at which the goal is reached.</summary>
        public double? Radius { get => (double?)this["radius"]; set => this["radius"] = value; }

        /// <summary>A field of the API that has no property here.</summary>
        public JToken this[string field]
        {
            get => fields[field];
            set
            {
                fields.Remove(field);
                Fields.Put(fields, field, value);
            }
        }

        internal JObject Json()
        {
            return fields;
        }
    }

    /// <summary>An agent to create (docs/api.md, "Agents"). The server chooses for null fields.</summary>
    public sealed class AgentSpec
    {
        public string Name { get; set; }

        /// <summary>"female" or "male".</summary>
        public string Gender { get; set; }

        public Place? Position { get; set; }

        /// <summary>Radians; in Unity's basis a yaw.</summary>
        public double? Heading { get; set; }

        /// <summary>Standing height in metres, in every basis. Not together with betas.</summary>
        public double? HeightM { get; set; }

        /// <summary>Ten shape coefficients.</summary>
        public double[] Betas { get; set; }

        /// <summary>Its clothes, e.g. "suit", "0" for none; null: its seed chooses.</summary>
        public string Outfit { get; set; }

        /// <summary>Determines its motion.</summary>
        public uint? Seed { get; set; }

        public bool? FootLock { get; set; }

        /// <summary>Take the body that <see cref="Api.FitBody"/> has found.</summary>
        public AgentSpec TakeBody(JObject fit)
        {
            Gender = (string)fit["gender"];
            Betas = fit["betas"].Select(beta => (double)beta).ToArray();
            HeightM = null;
            return this;
        }

        internal JObject Json()
        {
            var spec = new JObject();
            Fields.Put(spec, "name", Name);
            Fields.Put(spec, "gender", Gender);
            Fields.Put(spec, "position", Position.HasValue ? Position.Value.Json() : null);
            Fields.Put(spec, "heading", Heading);
            Fields.Put(spec, "phenotype", HeightM.HasValue ? new JObject { ["height_m"] = HeightM.Value } : null);
            Fields.Put(spec, "betas", Betas == null ? null : new JArray(Betas));
            Fields.Put(spec, "outfit", Outfit);
            Fields.Put(spec, "seed", Seed);
            Fields.Put(spec, "foot_lock", FootLock);
            return spec;
        }
    }

    internal static class Fields
    {
        /// <summary>Leave out null fields.</summary>
        public static void Put(JObject into, string name, JToken value)
        {
            var plain = value as JValue;
            if (value != null && (plain == null || plain.Value != null))
            {
                into[name] = value;
            }
        }
    }
}
