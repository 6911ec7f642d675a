/** Steps of the speed sliders, roughly logarithmic. Pure. */

/** Playback rates, sim seconds per second. */
export const PLAY_RATES = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100] as const;

/** Real-time factors of a simulator; the last one, 0, is as fast as possible. */
export const RUN_RATES = [0.25, 0.5, 1, 2, 5, 10, 20, 50, 100, 0] as const;

/** The step nearest to a rate, by ratio; 0 stands for no limit. */
export function nearestStep(rates: readonly number[], rate: number): number {
  const unlimited = rates.indexOf(0);
  if (rate === 0 && unlimited >= 0) return unlimited;
  let best = 0;
  let bestDistance = Infinity;
  rates.forEach((candidate, index) => {
    if (candidate === 0) return;
    const distance = Math.abs(Math.log(candidate / rate));
    if (distance < bestDistance) {
      bestDistance = distance;
      best = index;
    }
  });
  return best;
}

/** The rate `steps` further, clamped to the ends. */
export function shifted(rates: readonly number[], rate: number, steps: number): number {
  const index = nearestStep(rates, rate) + steps;
  return rates[Math.min(rates.length - 1, Math.max(0, index))]!;
}
