// What moves what. Of a report.

import { h, replace } from "../dom.ts";
import type { Sensitivity } from "../documents.ts";
import { sensitivityFigure } from "../figures/sensitivity.ts";
import { FigureList, valueOf, watchAll, type View } from "./view.ts";

export const sensitivityView: View = (root, context) => {
  const figures = new FigureList("figures single");
  const left = h("div", {});
  replace(root, h("h2", {}, "What moves what?"), figures.element, left);
  return watchAll(context, [`campaigns/${context.campaign}/sensitivity`], ([answer]) => {
    const sensitivity = valueOf<Sensitivity>(answer);
    if (sensitivity === null || sensitivity.quantities.length === 0) return;
    figures.update([sensitivityFigure(sensitivity)]);
    replace(left, sensitivity.left_out.length === 0 ? null :
      h("details", {}, h("summary", {}, "Left out"), h("ul", {}, sensitivity.left_out.map((what) => h("li", {}, what)))));
  });
};
