using System;

namespace Wayfarer
{
    /// <summary>
    /// Chooses the moment of the stream (server time) to show now, for all agents alike: clients/README.md, "Playout". Times
    /// are seconds; no clock is read. Nothing is allocated after warm-up.
    /// </summary>
    public sealed class PlayoutClock
    {
        private const double FirstDelay = 0.35;
        private const double MinDelay = 0.2;
        private const double MaxDelay = 1.5;
        private const double Margin = 0.06; // over the worst lateness of the window
        private const double LatenessWindow = 20;
        private const double OffsetWindow = 30; // seconds; its fastest message counts as one without delay
        private const double Stretch = 0.05; // playback runs at most this much faster or slower
        private const double Jump = 1.0; // error in seconds beyond which it jumps instead (after a sleep)

        private readonly WindowLeast transit = new WindowLeast(OffsetWindow); // local - server time of each message
        private readonly WindowLeast earliness = new WindowLeast(LatenessWindow); // of each chunk, negative when late
        private double offset = double.NaN; // the last known least transit
        private double playhead = double.NaN;
        private double last;
        private double caughtUpAt = double.NaN; // server time at which the stream was resumed last

        /// <summary>Note a message that came at local <paramref name="now"/>, sent at server time.</summary>
        public void Observe(double now, double sentAt)
        {
            if (double.IsNaN(offset))
            {
                earliness.Add(now, Margin - FirstDelay); // at first, expect as much as the first delay allows
            }
            transit.Add(now, now - sentAt);
            offset = transit.Least(now);
        }

        /// <summary>Note a chunk that came at local <paramref name="now"/>, whose first frame is for a time.</summary>
        public void ObserveChunk(double now, double scheduledAt)
        {
            if (!(scheduledAt < caughtUpAt))
            {
                earliness.Add(now, scheduledAt - ServerTime(now));
            }
        }

        /// <summary>
        /// Note that a connection was restored; its header was sent at server time <paramref name="sentAt"/>. Chunks
        /// for earlier times were missed meanwhile; their lateness predicts nothing.
        /// </summary>
        public void Resumed(double sentAt)
        {
            caughtUpAt = sentAt;
        }

        /// <summary>The server's clock at local <paramref name="now"/>, as if the fastest message had taken no time.</summary>
        public double ServerTime(double now)
        {
            return double.IsNaN(offset) ? now : now - offset;
        }

        /// <summary>The target delay, seconds.</summary>
        public double WantedDelay(double now)
        {
            double least = earliness.Least(now);
            return double.IsNaN(least) ? MinDelay : Math.Min(MaxDelay, Math.Max(MinDelay, Margin - least));
        }

        /// <summary>The present delay, seconds.</summary>
        public double Delay(double now)
        {
            return double.IsNaN(playhead) ? WantedDelay(now) : ServerTime(now) - playhead;
        }

        /// <summary>Advance to local <paramref name="now"/>; returns the moment to show, in server time.</summary>
        public double Advance(double now)
        {
            if (double.IsNaN(offset))
            {
                return now; // nothing has come yet
            }
            double ideal = ServerTime(now) - WantedDelay(now);
            if (double.IsNaN(playhead) || Math.Abs(ideal - playhead) > Jump)
            {
                playhead = ideal;
            }
            else
            {
                double step = Math.Max(0, now - last);
                double off = ideal - (playhead + step);
                playhead += step + Math.Min(Stretch * step, Math.Max(-Stretch * step, off));
            }
            last = now;
            return playhead;
        }

        /// <summary>The minimum of the last seconds, from a ring of values that rise from oldest to newest.</summary>
        private sealed class WindowLeast
        {
            private readonly double seconds;
            private double[] times = new double[64];
            private double[] values = new double[64];
            private int first;
            private int count;

            public WindowLeast(double seconds)
            {
                this.seconds = seconds;
            }

            public void Add(double now, double value)
            {
                while (count > 0 && values[Slot(count - 1)] >= value)
                {
                    count--;
                }
                if (count == values.Length)
                {
                    Grow();
                }
                times[Slot(count)] = now;
                values[Slot(count)] = value;
                count++;
            }

            /// <summary>NaN when there is none.</summary>
            public double Least(double now)
            {
                while (count > 0 && times[first] < now - seconds)
                {
                    first = Slot(1);
                    count--;
                }
                return count > 0 ? values[first] : double.NaN;
            }

            private int Slot(int k)
            {
                return (first + k) & (values.Length - 1);
            }

            private void Grow()
            {
                var longerTimes = new double[2 * times.Length];
                var longerValues = new double[2 * times.Length];
                for (int k = 0; k < count; k++)
                {
                    longerTimes[k] = times[Slot(k)];
                    longerValues[k] = values[Slot(k)];
                }
                times = longerTimes;
                values = longerValues;
                first = 0;
            }
        }
    }
}
