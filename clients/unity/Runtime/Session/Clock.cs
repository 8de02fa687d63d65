using System.Diagnostics;

namespace Wayfarer
{
    /// <summary>Seconds of a clock that never goes back: the one that a session is played by.</summary>
    public static class Clock
    {
        private static readonly double PerTick = 1.0 / Stopwatch.Frequency;

        public static double Now => Stopwatch.GetTimestamp() * PerTick;
    }
}
