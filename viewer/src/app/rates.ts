/**
 * The steps of the sliders for speed: even to the hand, each about as much faster than the one before. Pure.
 */

/** How fast a recording is played, sim seconds for each second. */
export const PLAY_RATES = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100] as const;

/** How fast a simulator is asked to run; the last one, 0, is as fast as it can. */
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

/** The rate some steps further, within the ends. */
export function shifted(rates: readonly number[], rate: number, steps: number): number {
  const index = nearestStep(rates, rate) + steps;
  return rates[Math.min(rates.length - 1, Math.max(0, index))]!;
}
