// Numbers and units as engineers write them: MPa instead of 1e6 Pa, percent for strains, degrees for angles. The rules are
// those of server/report/text/people_units.cc, so that page, report and terminal show one and the same.

/// shown = value [SI] * factor. label: empty for plain numbers.
export interface DisplayUnit {
  factor: number;
  label: string;
}

const STEPS: Record<string, [from: number, label: string][]> = {
  Pa: [[1, "Pa"], [1e3, "kPa"], [1e6, "MPa"], [1e9, "GPa"]],
  "N m/rad": [[1e-9, "nN m/rad"], [1e-6, "µN m/rad"], [1e-3, "mN m/rad"], [1, "N m/rad"]],
  m: [[1e-6, "µm"], [1e-3, "mm"], [1, "m"]],
  s: [[1e-6, "µs"], [1e-3, "ms"], [1, "s"]],
};

/// The unit in which a quantity whose largest size is `largest` [SI] is shown. The name decides where the SI unit does not:
/// strains are "1".
export function unitForPeople(name: string, siUnit: string, largest: number): DisplayUnit {
  const steps = STEPS[siUnit];
  if (steps !== undefined) {
    let [from, label] = steps[0]!;
    for (const step of steps) {
      if (largest >= step[0]) [from, label] = step;
    }
    return { factor: 1 / from, label };
  }
  if (siUnit === "rad") return { factor: 180 / Math.PI, label: "deg" };
  if (siUnit === "1" || siUnit === "") {
    return name.endsWith("strain") ? { factor: 100, label: "%" } : { factor: 1, label: "" };
  }
  return { factor: 1, label: siUnit };
}

export function largest(values: Iterable<number | null | undefined>): number {
  let size = 0;
  for (const value of values) {
    if (value != null && Number.isFinite(value)) size = Math.max(size, Math.abs(value));
  }
  return size;
}

/// "rolling resistance: friction" for "rolling_resistance.friction".
export function nameForPeople(name: string): string {
  return name.replaceAll(".", ": ").replaceAll("_", " ");
}

/// "axial strain [%]".
export function axisLabel(name: string, unit: DisplayUnit): string {
  return nameForPeople(name) + (unit.label === "" ? "" : ` [${unit.label}]`);
}

/// `digits` significant digits without trailing zeros, no exponent between 1e-3 and 1e6; "–" for what is not known.
export function numberText(value: number | null | undefined, digits = 4): string {
  if (value == null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  let text: string;
  if (size < 1e-3 || size >= 1e6) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e") as [string, string];
    text = `${trimmed(mantissa)}e${exponent.replace("+", "")}`;
  } else {
    text = trimmed(value.toFixed(Math.max(0, digits - Math.floor(Math.log10(size)) - 1)));
  }
  return text.replace("-", "−").replace("e-", "e−");
}

function trimmed(text: string): string {
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/// "4.1 GPa".
export function quantityText(value: number | null | undefined, name: string, siUnit: string, digits = 4): string {
  if (value == null) return "–";
  const unit = unitForPeople(name, siUnit, Math.abs(value));
  const text = numberText(value * unit.factor, digits);
  return unit.label === "" ? text : `${text}\u202f${unit.label}`;
}

/// A probability in percent; of what is not certain nothing is said to be: "> 99 %".
export function chanceText(probability: number | null | undefined): string {
  if (probability == null) return "–";
  const percent = 100 * probability;
  if (percent >= 99.5) return ">\u202f99\u202f%";
  if (percent < 0.5) return "<\u202f1\u202f%";
  return `${Math.round(percent)}\u202f%`;
}

/// "1 h 20 min", "35 s".
export function durationText(seconds: number | null | undefined): string {
  if (seconds == null || !(seconds >= 0)) return "–";
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

/// "2026-11-23 03:46 UTC".
export function dateText(unixMs: number): string {
  const iso = new Date(unixMs).toISOString();
  return `${iso.slice(0, 10)} ${iso.slice(11, 16)} UTC`;
}
