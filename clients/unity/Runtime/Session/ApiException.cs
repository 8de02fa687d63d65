using System;
using Newtonsoft.Json.Linq;

namespace Wayfarer
{
    /// <summary>A refusal of the server, or no answer at all (status 0).</summary>
    public sealed class ApiException : Exception
    {
        public ApiException(string message, int status, JObject problem = null, Exception cause = null)
            : base(message, cause)
        {
            Status = status;
            Problem = problem ?? new JObject();
        }

        /// <summary>The HTTP status, or 0.</summary>
        public int Status { get; }

        /// <summary>The whole problem document (RFC 9457), if there is one.</summary>
        public JObject Problem { get; }
    }
}
