using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>An item from a socket: a binary message, or finally its end.</summary>
    public struct SocketNews
    {
        /// <summary>The message is the first <see cref="Length"/> of these; they are valid until the next poll.</summary>
        public byte[] Bytes;

        public int Length;

        /// <summary>When it came, by <see cref="Clock.Now"/>.</summary>
        public double At;

        public bool Closed;

        /// <summary>Code of a close; 1006: there was none, the connection is lost.</summary>
        public int Code;

        public string Reason;
    }

    /// <summary>
    /// A WebSocket. <see cref="ClientSocket"/> is one; WebGL needs one of a plug-in, since .NET has none there
    /// (its <c>binaryType</c> must be <c>"arraybuffer"</c>).
    /// </summary>
    public interface ISocket
    {
        /// <summary>Connect; a failure is reported as a close.</summary>
        void Open(string url, IReadOnlyList<string> protocols);

        /// <summary>The next item; false: nothing more at present. Never waits.</summary>
        bool Poll(out SocketNews news);

        /// <summary>Send a text once it is open; an unsent text is lost with the connection. Never waits.</summary>
        void Send(string text);

        /// <summary>Close it; nothing more is polled.</summary>
        void Close();
    }
}
