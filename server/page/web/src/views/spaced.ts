const kMostRows = 20; // the chains of tmcmc take a hundred steps and more

/// All, or evenly spaced ones with the first and the last.
export function spaced<T>(all: readonly T[], most = kMostRows): T[] {
  if (all.length <= most) return [...all];
  return Array.from({ length: most }, (_, i) => all[Math.floor((i * (all.length - 1)) / (most - 1))]!);
}
