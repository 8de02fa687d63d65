using System.Diagnostics;

namespace Wayfarer
{
    /// <summary>Seconds of the clock of playback, which never goes back.</summary>
    public static class Clock
    {
        private static readonly double PerTick = 1.0 / Stopwatch.Frequency;

        public static double Now => Stopwatch.GetTimestamp() * PerTick;
    }
}
