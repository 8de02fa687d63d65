using System;
using System.Collections.Generic;
using System.Net.WebSockets;
using System.Text;
using System.Threading;
using System.Threading.Tasks;

namespace Wayfarer
{
    /// <summary>
    /// A WebSocket of System.Net.WebSockets: everywhere except in WebGL. A task of the thread pool receives. Messages
    /// wait in reused buffers of 8 MB at most; beyond that nothing is read, and the server sees a slow reader.
    /// </summary>
    public sealed class ClientSocket : ISocket
    {
        private const int MostWaiting = 8 << 20; // bytes
        private const int MostOfMessage = 16 << 20; // bytes
        private const int Lost = 1006;
        private const int TooBig = 1009;

        private readonly object gate = new object();
        private readonly Queue<SocketNews> waiting = new Queue<SocketNews>();
        private readonly Stack<byte[]> spare = new Stack<byte[]>();
        private readonly CancellationTokenSource left = new CancellationTokenSource();
        private readonly ClientWebSocket socket = new ClientWebSocket();
        private byte[] polled;
        private Task sending = Task.CompletedTask;
        private int waitingBytes;

        public void Open(string url, IReadOnlyList<string> protocols)
        {
            foreach (string protocol in protocols)
            {
                socket.Options.AddSubProtocol(protocol);
            }
            var address = new Uri(url);
            Task.Run(() => Run(address));
        }

        public bool Poll(out SocketNews news)
        {
            lock (gate)
            {
                if (polled != null)
                {
                    spare.Push(polled);
                    polled = null;
                }
                if (waiting.Count == 0 || left.IsCancellationRequested)
                {
                    news = default(SocketNews);
                    return false;
                }
                news = waiting.Dequeue();
                polled = news.Bytes;
                waitingBytes -= news.Length;
                return true;
            }
        }

        public void Send(string text)
        {
            byte[] bytes = Encoding.UTF8.GetBytes(text);
            lock (gate)
            {
                sending = sending.ContinueWith(_ => SendNow(bytes), TaskScheduler.Default).Unwrap();
            }
        }

        private async Task SendNow(byte[] bytes)
        {
            try
            {
                var part = new ArraySegment<byte>(bytes);
                await socket.SendAsync(part, WebSocketMessageType.Text, true, left.Token).ConfigureAwait(false);
            }
            catch (Exception error) when (error is WebSocketException || error is ObjectDisposedException || error is InvalidOperationException || error is OperationCanceledException)
            {
                // the connection was lost in this moment, which the receiver reports
            }
        }

        public void Close()
        {
            if (socket.State == WebSocketState.Open)
            {
                Task.Run(() => SayGoodbye());
            }
            else
            {
                left.Cancel();
            }
        }

        /// <summary>Tell the server that the socket closes, without waiting.</summary>
        private async Task SayGoodbye()
        {
            try
            {
                Task said = socket.CloseOutputAsync(WebSocketCloseStatus.NormalClosure, "", left.Token);
                await Task.WhenAny(said, Task.Delay(1000)).ConfigureAwait(false);
            }
            catch (Exception error) when (error is WebSocketException || error is ObjectDisposedException || error is InvalidOperationException)
            {
                // the connection was lost in this moment
            }
            left.Cancel();
        }

        private async Task Run(Uri address)
        {
            var close = new SocketNews { Closed = true, Code = Lost };
            try
            {
                await socket.ConnectAsync(address, left.Token).ConfigureAwait(false);
                close.Code = await Receive().ConfigureAwait(false);
                close.Reason = close.Code == TooBig ? "a message has more than 16 MB" : socket.CloseStatusDescription;
            }
            catch (Exception error) // of many kinds: the connection is lost in any case
            {
                close.Reason = Innermost(error).Message;
            }
            finally
            {
                socket.Dispose();
            }
            close.At = Clock.Now;
            Add(close);
        }

        /// <summary>Receive until the socket is closed; returns the close code.</summary>
        private async Task<int> Receive()
        {
            byte[] buffer = Spare();
            int length = 0;
            for (;;)
            {
                while (Volatile.Read(ref waitingBytes) > MostWaiting)
                {
                    await Task.Delay(20, left.Token).ConfigureAwait(false);
                }
                var room = new ArraySegment<byte>(buffer, length, buffer.Length - length);
                WebSocketReceiveResult part = await socket.ReceiveAsync(room, left.Token).ConfigureAwait(false);
                if (part.MessageType == WebSocketMessageType.Close)
                {
                    return socket.CloseStatus.HasValue ? (int)socket.CloseStatus.Value : Lost;
                }
                length += part.Count;
                if (part.EndOfMessage)
                {
                    Add(new SocketNews { Bytes = buffer, Length = length, At = Clock.Now });
                    buffer = Spare();
                    length = 0;
                }
                else if (length == buffer.Length)
                {
                    if (length >= MostOfMessage)
                    {
                        return TooBig;
                    }
                    Array.Resize(ref buffer, 2 * length);
                }
            }
        }

        private byte[] Spare()
        {
            lock (gate)
            {
                return spare.Count > 0 ? spare.Pop() : new byte[1 << 16];
            }
        }

        private void Add(SocketNews news)
        {
            lock (gate)
            {
                waiting.Enqueue(news);
                waitingBytes += news.Length;
            }
        }

        private static Exception Innermost(Exception error)
        {
            return error.InnerException == null ? error : Innermost(error.InnerException);
        }
    }
}
