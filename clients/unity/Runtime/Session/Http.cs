using System;
using System.Collections.Generic;
using System.Net.Http;
using System.Text;
using System.Threading;
using System.Threading.Tasks;

namespace Wayfarer
{
    /// <summary>A call of a server's HTTP API; <c>Body</c>: JSON, or null.</summary>
    public sealed class HttpCall
    {
        public string Method { get; set; }

        public string Url { get; set; }

        public string Body { get; set; }

        /// <summary>Value of the header <c>authorization</c>, or null.</summary>
        public string Authorization { get; set; }

        public double Seconds { get; set; }
    }

    /// <summary>The server's answer.</summary>
    public sealed class HttpReply
    {
        public int Status { get; set; }

        public string Body { get; set; }
    }

    /// <summary>
    /// Sends calls. <see cref="Http"/> uses HttpClient, which WebGL lacks; it needs another (by
    /// UnityWebRequest).
    /// </summary>
    public interface IHttp
    {
        /// <exception cref="Exception">There is no answer; its message says why.</exception>
        Task<HttpReply> Send(HttpCall call);
    }

    /// <summary>Sends calls with System.Net.Http.</summary>
    public sealed class Http : IHttp
    {
        private static readonly HttpClient Client = new HttpClient { Timeout = Timeout.InfiniteTimeSpan };

        public async Task<HttpReply> Send(HttpCall call)
        {
            using (var patience = new CancellationTokenSource(TimeSpan.FromSeconds(call.Seconds)))
            using (var request = new HttpRequestMessage(new HttpMethod(call.Method), call.Url))
            {
                request.Headers.TryAddWithoutValidation("accept", "application/json");
                if (call.Authorization != null)
                {
                    request.Headers.TryAddWithoutValidation("authorization", call.Authorization);
                }
                if (call.Body != null)
                {
                    request.Content = new StringContent(call.Body, Encoding.UTF8, "application/json");
                }
                try
                {
                    using (HttpResponseMessage reply = await Client.SendAsync(request, patience.Token).ConfigureAwait(false))
                    {
                        string body = await reply.Content.ReadAsStringAsync().ConfigureAwait(false);
                        return new HttpReply { Status = (int)reply.StatusCode, Body = body };
                    }
                }
                catch (OperationCanceledException)
                {
                    throw new TimeoutException("no answer within " + call.Seconds + " s");
                }
            }
        }
    }
}
