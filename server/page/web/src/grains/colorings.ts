// By what grains are coloured; apart from the scene, so that the choice is known before three.js is loaded.

export const kColorings = ["force", "speed", "coordination"] as const;
export type Coloring = (typeof kColorings)[number];

/// Viridis at nine equal steps [van der Walt & Smith 2015], linear between them. share in [0, 1]; gives sRGB in [0, 1].
const kViridis: [number, number, number][] = [
  [0.267, 0.005, 0.329], [0.283, 0.141, 0.458], [0.254, 0.265, 0.53], [0.207, 0.372, 0.553], [0.164, 0.471, 0.558],
  [0.128, 0.567, 0.551], [0.267, 0.749, 0.441], [0.627, 0.855, 0.224], [0.993, 0.906, 0.144],
];

export function viridis(share: number): [number, number, number] {
  const at = Math.min(1, Math.max(0, Number.isFinite(share) ? share : 0)) * (kViridis.length - 1);
  const low = Math.min(Math.floor(at), kViridis.length - 2);
  const mix = at - low;
  const [a, b] = [kViridis[low]!, kViridis[low + 1]!];
  return [0, 1, 2].map((k) => a[k]! + (b[k]! - a[k]!) * mix) as [number, number, number];
}
