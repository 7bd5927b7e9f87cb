// Which campaign comes from which, as rows of a list.

import type { Status } from "../documents.ts";
import { nameForPeople } from "../units.ts";

export const kFoldFrom = 6; // derived campaigns below one base that are shown only when asked for

export interface Row {
  status: Status;
  depth: number;
  kin: number; // campaigns below it
}

/// Campaigns in the order of their numbers, what comes from one below it. unfolded: whose many children are shown.
export function familyRows(list: readonly Status[], unfolded: ReadonlySet<string>): Row[] {
  const known = new Set(list.map(({ campaign }) => campaign));
  const children = new Map<string, Status[]>();
  const roots: Status[] = [];
  for (const status of list) {
    if (status.parent !== null && known.has(status.parent) && status.parent !== status.campaign) {
      const siblings = children.get(status.parent) ?? [];
      siblings.push(status);
      children.set(status.parent, siblings);
    } else {
      roots.push(status);
    }
  }
  const rows: Row[] = [];
  const below = (id: string): number => (children.get(id) ?? []).reduce((sum, { campaign }) => sum + 1 + below(campaign), 0);
  const add = (status: Status, depth: number): void => {
    const kin = below(status.campaign);
    rows.push({ status, depth, kin });
    if (kin >= kFoldFrom && !unfolded.has(status.campaign)) {
      // A calibrated model of its own is no detail: it stays in sight.
      for (const child of children.get(status.campaign) ?? []) if (child.purpose === "extension") add(child, depth + 1);
      return;
    }
    for (const child of children.get(status.campaign) ?? []) add(child, depth + 1);
  };
  for (const root of roots) add(root, 0);
  return rows;
}

/// "extension with rolling resistance".
export function originOf({ purpose, effects }: Pick<Status, "purpose" | "effects">): string {
  const added = effects.length === 0 ? "" : `with ${effects.map(nameForPeople).join(", ")}`;
  return [purpose === null ? "" : nameForPeople(purpose), added].filter((text) => text !== "").join(" ");
}
