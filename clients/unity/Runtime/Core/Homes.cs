using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text.RegularExpressions;

namespace Wayfarer
{
    /// <summary>
    /// The nodes at which sessions, scenes and agents live, as far as is known: where a call goes when a server is many
    /// nodes (clients/README.md, "Many nodes"). Any thread may call.
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

        /// <summary>The address at which the one whose id is in a text is called.</summary>
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

        /// <summary>They live there.</summary>
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

        /// <summary>Nobody knows where they live, but the entry.</summary>
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
    /// The addresses that a call, or a stream, goes to in turn. At most four: the node that is known, the one that it
    /// names, the entry, the one that it names.
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

        /// <param name="homes">What is known.</param>
        /// <param name="about">Text with the id of whom the call concerns; "": nobody's.</param>
        public Route(Homes homes, string about)
        {
            this.homes = homes;
            this.about = about;
            Begin();
        }

        /// <summary>Where it goes next.</summary>
        public string Address { get; private set; }

        /// <summary>Start again: as for a new call.</summary>
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
        /// <see cref="Address"/> has named another node; whether the call goes on, to the new one. Port 0, or what is no host's
        /// name: it has named none.
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

        /// <summary><see cref="Address"/> does not answer, or not at present; as <see cref="Misdirected"/>.</summary>
        public bool Unavailable()
        {
            return Ask();
        }

        /// <summary>A call was refused, by an HTTP status (0: no answer) and the problem's endpoint; whether it goes on.</summary>
        public bool Refused(int status, string host, int port)
        {
            return status == Elsewhere ? Misdirected(host, port) : (status == NoAnswer || status == NotNow) && Unavailable();
        }

        /// <summary>A stream has ended; whether to connect to <see cref="Address"/> at once.</summary>
        public bool Closed(int code, string reason)
        {
            if (code == StreamElsewhere)
            {
                int port;
                string host = PlaceOf(reason, out port);
                return Misdirected(host, port);
            }
            Unavailable(); // in a cluster its node is gone, perhaps; in any case not at once
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
