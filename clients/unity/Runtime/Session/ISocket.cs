using System.Collections.Generic;

namespace Wayfarer
{
    /// <summary>Something that came over a socket: a binary message, or, last of all, its end.</summary>
    public struct SocketNews
    {
        /// <summary>The message is the first <see cref="Length"/> of these; they are right until the next poll.</summary>
        public byte[] Bytes;

        public int Length;

        /// <summary>When it came, by <see cref="Clock.Now"/>.</summary>
        public double At;

        public bool Closed;

        /// <summary>Of a close: its code; 1006: there was none, the connection is lost.</summary>
        public int Code;

        public string Reason;
    }

    /// <summary>
    /// A WebSocket. <see cref="ClientSocket"/> is one; WebGL, where .NET has none, needs one of a plug-in
    /// (its <c>binaryType</c> must be <c>"arraybuffer"</c>).
    /// </summary>
    public interface ISocket
    {
        /// <summary>Connect; that this fails is told as a close.</summary>
        void Open(string url, IReadOnlyList<string> protocols);

        /// <summary>What came next; false: nothing more at present. Never waits.</summary>
        bool Poll(out SocketNews news);

        /// <summary>Send a text, once it is open; one that cannot be sent is lost with the connection. Never waits.</summary>
        void Send(string text);

        /// <summary>Close it; nothing more is polled.</summary>
        void Close();
    }
}
