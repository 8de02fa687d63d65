using System;
using System.Collections.Generic;
using System.Text;

namespace Wayfarer
{
    /// <summary>The key or token (JWT) of a server that asks for one; "": none.</summary>
    public sealed class Access
    {
        private const string Protocol = "wayfarer.v1";

        public Access(string token = "")
        {
            Token = token ?? "";
        }

        /// <summary>The token. Replace it when it has expired: the next call and the next connection use the new one.</summary>
        public string Token { get; set; }

        /// <summary>Value of the header <c>authorization</c>, or null.</summary>
        public string Header => Token == "" ? null : "Bearer " + Token;

        /// <summary>Subprotocols of a WebSocket: where the stream takes the token from.</summary>
        public IReadOnlyList<string> Protocols
        {
            get
            {
                if (Token == "")
                {
                    return new[] { Protocol };
                }
                string packed = Convert.ToBase64String(Encoding.UTF8.GetBytes(Token));
                packed = packed.Replace('+', '-').Replace('/', '_').TrimEnd('=');
                return new[] { Protocol, "wayfarer.token." + packed };
            }
        }
    }
}
