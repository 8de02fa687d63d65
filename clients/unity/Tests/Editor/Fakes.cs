using System;
using System.Collections.Generic;
using System.Threading.Tasks;

namespace Wayfarer.Tests
{
    /// <summary>A socket that the test drives by hand.</summary>
    internal sealed class FakeSocket : ISocket
    {
        private readonly Queue<SocketNews> waiting = new Queue<SocketNews>();

        public string Url { get; private set; }

        public IReadOnlyList<string> Protocols { get; private set; }

        public bool Closed { get; private set; }

        public void Open(string url, IReadOnlyList<string> protocols)
        {
            Url = url;
            Protocols = protocols;
        }

        public bool Poll(out SocketNews news)
        {
            news = waiting.Count > 0 ? waiting.Dequeue() : default(SocketNews);
            return news.Closed || news.Bytes != null;
        }

        public List<string> Sent { get; } = new List<string>();

        public void Send(string text)
        {
            Sent.Add(text);
        }

        public void Close()
        {
            Closed = true;
        }

        public void Say(string message, double at = 5)
        {
            Say(Golden.Message(message), at);
        }

        public void Say(byte[] bytes, double at = 5)
        {
            waiting.Enqueue(new SocketNews { Bytes = bytes, Length = bytes.Length, At = at });
        }

        public void End(int code, string reason = "")
        {
            waiting.Enqueue(new SocketNews { Closed = true, Code = code, Reason = reason });
        }
    }

    /// <summary>A server that gives prepared answers, and notes what it was asked.</summary>
    internal sealed class FakeHttp : IHttp
    {
        private readonly Queue<HttpReply> answers = new Queue<HttpReply>();
        private HttpReply last = new HttpReply { Status = 204, Body = "" };

        public List<HttpCall> Asked { get; } = new List<HttpCall>();

        /// <summary>Thrown in place of an answer, or null.</summary>
        public Exception Failure { get; set; }

        /// <summary>Give these answers, and repeat the last.</summary>
        public FakeHttp Answer(int status, string body = "")
        {
            answers.Enqueue(new HttpReply { Status = status, Body = body });
            return this;
        }

        public Task<HttpReply> Send(HttpCall call)
        {
            Asked.Add(call);
            if (Failure != null)
            {
                throw Failure;
            }
            last = answers.Count > 0 ? answers.Dequeue() : last;
            return Task.FromResult(last);
        }
    }
}
