using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text.RegularExpressions;

namespace Wayfarer
{
    /// <summary>
    /// The nodes at which sessions, scenes and agents live, as far as is known: the routes of calls when a server is
    /// many nodes (clients/README.md, "Many nodes"). Any thread may call.
    /// </summary>
    public sealed class Homes
    {
        private static readonly Regex Slot = new Regex("(?:session|scene|agent)-([0-9a-f]{4})");
        private static readonly Regex Parts = new Regex(@"^(https?://|)(\[[^\]]*\]|[^:]*)");

        private readonly Dictionary<string, string> homes = new Dictionary<string, string>(); // addresses by slot

        /// <param name="entry">The server's address, "http://host:port" or "host:port".</param>
        public Homes(string entry)
        {
            Entry = entry;
        }

        public string Entry { get; }

        /// <summary>The address for calls about the id in a text.</summary>
        public string Home(string about)
        {
            lock (homes)
            {
                string address;
                return homes.TryGetValue(SlotOf(about), out address) ? address : Entry;
            }
        }

        /// <summary>A node's address, by the entry's scheme. <paramref name="host"/>: "" is the entry's.</summary>
        public string Node(string host, int port)
        {
            Match own = Parts.Match(Entry);
            string name = host.Contains(":") && !host.StartsWith("[", StringComparison.Ordinal) ? "[" + host + "]" : host; // IPv6
            return own.Groups[1].Value + (name == "" ? own.Groups[2].Value : name) + ":" + port.ToString(CultureInfo.InvariantCulture);
        }

        /// <summary>Note that the slot of a text lives at an address.</summary>
        public void Learn(string about, string address)
        {
            string slot = SlotOf(about);
            lock (homes)
            {
                if (slot != "")
                {
                    homes[slot] = address;
                }
            }
        }

        /// <summary>Forget where it lives; only the entry knows.</summary>
        public void Forget(string about)
        {
            lock (homes)
            {
                homes.Remove(SlotOf(about));
            }
        }

        /// <summary>The slot of the first id in a text, which a session and its agents share; "" without one.</summary>
        internal static string SlotOf(string about)
        {
            return Slot.Match(about).Groups[1].Value;
        }
    }

    /// <summary>
    /// The addresses to which a call or a stream goes in turn. At most four: the known node, the node it names, the
    /// entry, and the node that the entry names.
    /// </summary>
    public sealed class Route
    {
        private const int NoAnswer = 0, Elsewhere = 421, NotNow = 503, StreamElsewhere = 4421;

        private static readonly Regex Host = new Regex(@"^[A-Za-z0-9_.:\[\]-]*$");
        private static readonly Regex Place = new Regex("^call (.*):([0-9]{1,5})$");

        private readonly Homes homes;
        private readonly string about;
        private bool asked; // the entry
        private bool followed;

        /// <param name="homes">The known nodes.</param>
        /// <param name="about">Text with the id that the call concerns; "": none.</param>
        public Route(Homes homes, string about)
        {
            this.homes = homes;
            this.about = about;
            Begin();
        }

        /// <summary>Where it goes next.</summary>
        public string Address { get; private set; }

        /// <summary>Start again, as for a new call.</summary>
        public void Begin()
        {
            Address = homes.Home(about);
            asked = Address == homes.Entry;
            followed = false;
        }

        /// <summary>The call has succeeded, or the stream has begun. <paramref name="made"/>: id of what was made by it.</summary>
        public void Answered(string made = "")
        {
            if (Address != homes.Entry)
            {
                homes.Learn(Homes.SlotOf(made) == "" ? about : made, Address);
            }
            Begin();
        }

        /// <summary>
        /// Note that <see cref="Address"/> has named another node; returns whether the call continues there. Port 0, or
        /// an invalid host name: it has named none.
        /// </summary>
        public bool Misdirected(string host, int port)
        {
            if (followed || port <= 0 || port > ushort.MaxValue || !Host.IsMatch(host))
            {
                return Ask();
            }
            followed = true;
            Address = homes.Node(host, port);
            homes.Learn(about, Address);
            return true;
        }

        /// <summary>Note that <see cref="Address"/> does not answer at present; as <see cref="Misdirected"/>.</summary>
        public bool Unavailable()
        {
            return Ask();
        }

        /// <summary>Note a refusal, by an HTTP status (0: no answer) and endpoint. Returns whether the call continues.</summary>
        public bool Refused(int status, string host, int port)
        {
            return status == Elsewhere ? Misdirected(host, port) : (status == NoAnswer || status == NotNow) && Unavailable();
        }

        /// <summary>Note a stream's end; returns whether to connect to <see cref="Address"/> at once.</summary>
        public bool Closed(int code, string reason)
        {
            if (code == StreamElsewhere)
            {
                int port;
                string host = PlaceOf(reason, out port);
                return Misdirected(host, port);
            }
            Unavailable(); // its node may have left the cluster; in any case not at once
            return false;
        }

        /// <summary>Host and port that the close reason of a stream names (code 4421); port 0: none.</summary>
        public static string PlaceOf(string reason, out int port)
        {
            Match found = Place.Match(reason);
            port = found.Success ? int.Parse(found.Groups[2].Value, CultureInfo.InvariantCulture) : 0;
            return found.Groups[1].Value;
        }

        private bool Ask()
        {
            homes.Forget(about);
            if (asked)
            {
                return false;
            }
            asked = true;
            followed = false;
            Address = homes.Entry;
            return true;
        }
    }
}
