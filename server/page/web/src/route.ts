// Where the page is: #/ campaigns, #/workers, #/ID/VIEW?key=value. The fragment never reaches the server.

export const kViews = ["progress", "fit", "misfit", "parameters", "missing", "error", "grains"] as const;
export type ViewName = (typeof kViews)[number];

export interface Route {
  campaign: string | null; // null: the list of all, or workers
  view: ViewName | "campaigns" | "workers";
  options: URLSearchParams;
}

export function readRoute(fragment: string): Route {
  const [path = "", query = ""] = fragment.replace(/^#?\/?/, "").split("?");
  const options = new URLSearchParams(query);
  const [first = "", second = ""] = path.split("/").map(decoded);
  if (first === "") return { campaign: null, view: "campaigns", options };
  if (first === "workers") return { campaign: null, view: "workers", options };
  const view = kViews.find((name) => name === second) ?? "progress";
  return { campaign: first, view, options };
}

export function linkTo(campaign: string, view: ViewName, options: Record<string, string> = {}): string {
  const query = new URLSearchParams(options).toString();
  return `#/${encodeURIComponent(campaign)}/${view}${query === "" ? "" : `?${query}`}`;
}

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}
