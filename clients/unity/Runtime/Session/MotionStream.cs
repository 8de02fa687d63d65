using System;
using System.IO;

namespace Wayfarer
{
    /// <summary>State of a stream's connection.</summary>
    public enum StreamStatus
    {
        Connecting,
        Open,
        Lost,
    }

    /// <summary>
    /// Brings a session's motion to a player. A lost connection is restored and resumes where it was. It starts no
    /// thread and reads no clock; everything happens in <see cref="Update"/>.
    /// </summary>
    public sealed class MotionStream
    {
        private const double RetryFirst = 0.5; // seconds; doubled at each failure
        private const double RetryMost = 8;
        private const double Pause = 0.1; // least seconds between two texts
        private const double Silence = 2.5; // seconds without a heartbeat (one per second) that mean a dead connection
        private const int Gone = 1000, Invalid = 4422, UnknownCaller = 4401, Forbidden = 4403, NotFound = 4404, NoCode = 1006;

        private readonly Func<string, StreamAddress> address;
        private readonly MotionPlayer player;
        private readonly Func<ISocket> newSocket;
        private readonly Route route;
        private ISocket socket;
        private double retry = RetryFirst;
        private double retryAt;
        private double heardAt;
        private string text = ""; // waiting to be sent
        private string said = "";
        private double saidAt = double.NegativeInfinity;
        private bool begun; // this connection's header has come
        private string forgotten = ""; // a resume token unknown to the server

        /// <param name="address">Where to connect, by resume token (<see cref="Api.StreamAddress"/>).</param>
        /// <param name="player">The receiver of the motion.</param>
        /// <param name="newSocket">Makes a socket; null: <see cref="ClientSocket"/>.</param>
        /// <param name="route">Receives the outcome of an address; null: there is only one.</param>
        public MotionStream(
            Func<string, StreamAddress> address, MotionPlayer player, Func<ISocket> newSocket = null, Route route = null)
        {
            this.route = route;
            this.address = address;
            this.player = player;
            this.newSocket = newSocket ?? (() => new ClientSocket());
        }

        /// <summary>The connection's state, and why it was lost.</summary>
        public event Action<StreamStatus, string> StatusChanged;

        /// <summary>The session is gone.</summary>
        public event Action<string> Ended;

        /// <summary>The caller must authenticate; it may then <see cref="Open"/> again.</summary>
        public event Action<string> Refused;

        /// <summary>Another attempt is pointless.</summary>
        public event Action<string> Failed;

        /// <summary>Whether it has stopped: after Close, Ended, Refused or Failed.</summary>
        public bool Closed { get; private set; }

        /// <summary>Connect at the next update, after the stream was refused.</summary>
        public void Open()
        {
            Closed = false;
            retry = RetryFirst;
            retryAt = double.NegativeInfinity;
        }

        /// <summary>Send a text. Only the last within a tenth of a second is sent, and none twice.</summary>
        public void Say(string text)
        {
            if (text != said)
            {
                this.text = said = text;
            }
        }

        /// <summary>Take all messages until <paramref name="now"/>, and maintain the connection. Never waits.</summary>
        public void Update(double now)
        {
            if (!Closed && socket == null && now >= retryAt)
            {
                route?.Begin();
                Connect(now);
            }
            SocketNews news;
            while (!Closed && socket != null && socket.Poll(out news))
            {
                if (news.Closed)
                {
                    TakeLoss(news.Code, news.Reason ?? "", now);
                }
                else
                {
                    Receive(news, now);
                }
            }
            if (!Closed && socket != null && begun && text != "" && now - saidAt >= Pause)
            {
                socket.Send(text);
                text = "";
                saidAt = now;
            }
            if (!Closed && socket != null && now - heardAt > Silence)
            {
                Reconnect("nothing has come for " + Silence + " s", now); // half-open: it would never close by itself
            }
        }

        /// <summary>Close the stream.</summary>
        public void Close()
        {
            Closed = true;
            Drop();
        }

        /// <summary>Connect again, as after a loss: the network may have changed.</summary>
        public void Reconnect(string reason, double now)
        {
            if (Closed || socket == null)
            {
                return;
            }
            TakeLoss(NoCode, reason, now);
        }

        private void Connect(double now)
        {
            StatusChanged?.Invoke(StreamStatus.Connecting, "");
            player.Begin();
            begun = false;
            string token = player.ResumeToken;
            StreamAddress where = address(token == forgotten ? "" : token);
            heardAt = now;
            socket = newSocket();
            socket.Open(where.Url, where.Protocols);
        }

        private void Receive(SocketNews news, double now)
        {
            heardAt = now;
            try
            {
                if (player.Receive(news.Bytes, news.Length, news.At) != MessageKind.Header)
                {
                    return;
                }
            }
            catch (InvalidDataException error)
            {
                Close();
                Failed?.Invoke("cannot read the stream: " + error.Message);
                return;
            }
            retry = RetryFirst;
            begun = true;
            route?.Answered();
            StatusChanged?.Invoke(StreamStatus.Open, "");
        }

        private void TakeLoss(int code, string reason, double now)
        {
            Drop();
            string token = player.ResumeToken;
            if (code == Invalid && token != forgotten)
            {
                forgotten = token; // perhaps of another server: begin with the frames due next
                Connect(now);
                return;
            }
            Closed = code == Gone || code == NotFound || code == UnknownCaller || code == Forbidden || code == Invalid;
            if (!Closed && route != null && route.Closed(code, reason))
            {
                Connect(now);
            }
            else if (!Closed)
            {
                retryAt = now + retry;
                retry = Math.Min(RetryMost, 2 * retry);
                StatusChanged?.Invoke(StreamStatus.Lost, reason);
            }
            else if (code == UnknownCaller)
            {
                Refused?.Invoke(reason);
            }
            else if (code == Gone || code == NotFound)
            {
                Ended?.Invoke(reason);
            }
            else
            {
                Failed?.Invoke(reason);
            }
        }

        private void Drop()
        {
            socket?.Close();
            socket = null;
        }
    }
}
