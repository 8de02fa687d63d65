using System.Linq;
using Newtonsoft.Json.Linq;
using NUnit.Framework;

namespace Wayfarer.Tests
{
    /// <summary>Where a call goes next: the cases of every client.</summary>
    public class HomesTests
    {
        [Test]
        public void A_call_goes_where_the_rule_says()
        {
            foreach (JToken each in Golden.Document("homes.json")["cases"])
            {
                var name = (string)each["name"];
                var homes = new Homes((string)each["entry"]);
                foreach (JToken call in each["calls"])
                {
                    var route = new Route(homes, (string)call["about"]);
                    int count = call["called"].Count();
                    for (int k = 0; k < count; k++)
                    {
                        Assert.AreEqual((string)call["called"][k], route.Address, name);
                        Answer(route, (JObject)call["answers"][k], k == count - 1, (bool)call["fails"], name);
                    }
                }
                Assert.AreEqual((string)each["home"], homes.Home((string)each["about"]), name);
            }
        }

        [Test]
        public void A_streams_close_reason_names_the_node()
        {
            foreach (JToken each in Golden.Document("homes.json")["reasons"])
            {
                int port;
                Assert.AreEqual((string)each[1], Route.PlaceOf((string)each[0], out port), (string)each[0]);
                Assert.AreEqual((int)each[2], port, (string)each[0]);
            }
        }

        private static void Answer(Route route, JObject answer, bool last, bool fails, string name)
        {
            if (answer["answered"] != null)
            {
                Assert.IsTrue(last && !fails, name);
                route.Answered((string)answer["answered"]);
            }
            else if (answer["unavailable"] != null)
            {
                Assert.AreEqual(!last, route.Unavailable(), name);
            }
            else
            {
                JToken place = answer["misdirected"];
                Assert.AreEqual(!last, route.Misdirected((string)place[0], (int)place[1]), name);
            }
        }
    }
}
