// Grains as spheres, contact forces as rods whose thickness is the force: one instanced mesh each, drawn only when something moves.

import * as three from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Grains } from "../documents.ts";
import { viridis, type Coloring } from "./colorings.ts";

export interface Scene {
  range: [number, number]; // of what the colour says, SI
  dispose(): void;
}

const kThickest = 0.35; // of the mean radius, for the largest force
const kHalfView = 0.29; // tangent of half the angle of view, of the shorter side
const kTurn = Math.PI / 24; // a key's
const kNearer = 0.9;

/// Throws where the browser gives no WebGL.
export function makeScene(canvas: HTMLCanvasElement, document: Grains, coloring: Coloring): Scene {
  const renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  const { grains, contacts, cell } = document;
  const count = grains.x.length;
  const center = new three.Vector3(...[0, 1, 2].map((k) => ((cell.min[k] ?? 0) + (cell.max[k] ?? 0)) / 2));
  const size = new three.Vector3(...[0, 1, 2].map((k) => (cell.max[k] ?? 1) - (cell.min[k] ?? 0)));
  const unit = 1 / Math.max(size.x, size.y, size.z); // the scene is of size one
  const scene = new three.Scene();
  scene.scale.setScalar(unit);
  const content = new three.Group();
  content.position.copy(center).negate();
  scene.add(content);

  const values = coloring === "force" ? contacts.normal_force : grains[coloring];
  const [low, high] = extent(values);
  const share = (value: number): number => (high > low ? (value - low) / (high - low) : 0.5);

  const spheres = new three.InstancedMesh(
    new three.IcosahedronGeometry(1, 3),
    new three.MeshStandardMaterial({ roughness: 0.75, transparent: coloring === "force", opacity: coloring === "force" ? 0.16 : 1, depthWrite: coloring !== "force" }),
    count,
  );
  const matrix = new three.Matrix4();
  const color = new three.Color();
  for (let i = 0; i < count; ++i) {
    const radius = grains.radius[i]!;
    matrix.makeScale(radius, radius, radius).setPosition(grains.x[i]!, grains.y[i]!, grains.z[i]!);
    spheres.setMatrixAt(i, matrix);
    if (coloring === "force") color.setRGB(0.55, 0.6, 0.66, three.SRGBColorSpace);
    else color.setRGB(...viridis(share(grains[coloring][i]!)), three.SRGBColorSpace);
    spheres.setColorAt(i, color);
  }
  content.add(spheres);
  if (coloring === "force") content.add(rods(document, share));
  content.add(box(cell));

  scene.add(new three.HemisphereLight(0xffffff, 0x556070, 2.2));
  const sun = new three.DirectionalLight(0xffffff, 1.6);
  sun.position.set(1, 2, 3);
  scene.add(sun);

  const camera = new three.PerspectiveCamera(1, 1, 0.01, 20);
  camera.position.set(2.2, -1.9, 1.1); // all of a cube of size one in sight
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false; // nothing moves that nobody moves
  const draw = (): void => renderer.render(scene, camera);
  controls.addEventListener("change", draw);

  const fit = (): void => {
    const { clientWidth: width, clientHeight: height } = canvas;
    renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    renderer.setSize(width, height, false);
    camera.aspect = width / Math.max(1, height);
    camera.fov = 2 * three.MathUtils.radToDeg(Math.atan(kHalfView / Math.min(1, camera.aspect))); // of the height
    camera.updateProjectionMatrix();
    draw();
  };
  const whenResized = new ResizeObserver(fit);
  whenResized.observe(canvas);
  const onKey = (event: KeyboardEvent): void => {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-kTurn, 0, 1], ArrowRight: [kTurn, 0, 1], ArrowUp: [0, -kTurn, 1], ArrowDown: [0, kTurn, 1],
      "+": [0, 0, kNearer], "-": [0, 0, 1 / kNearer],
    };
    const turn = turns[event.key];
    if (turn === undefined) return;
    event.preventDefault();
    const place = new three.Spherical().setFromVector3(new three.Vector3(camera.position.x, camera.position.z, -camera.position.y));
    place.theta += turn[0];
    place.phi += turn[1];
    place.radius *= turn[2];
    place.makeSafe();
    const moved = new three.Vector3().setFromSpherical(place);
    camera.position.set(moved.x, -moved.z, moved.y);
    controls.update();
    draw();
  };
  canvas.addEventListener("keydown", onKey);
  controls.update();
  fit();
  return {
    range: [low, high],
    dispose(): void {
      whenResized.disconnect();
      canvas.removeEventListener("keydown", onKey);
      controls.dispose();
      scene.traverse((object) => {
        if (object instanceof three.Mesh || object instanceof three.LineSegments) {
          object.geometry.dispose();
          (object.material as three.Material).dispose();
        }
      });
      renderer.dispose();
    },
  };
}

function extent(values: readonly number[]): [number, number] {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low <= high ? [low, high] : [0, 0];
}

// From centre to centre; those that reach across a periodic border are left out.
function rods({ grains, contacts, cell }: Grains, share: (value: number) => number): three.InstancedMesh {
  const largest = Math.max(...contacts.normal_force, Number.MIN_VALUE);
  const meanRadius = grains.radius.reduce((sum, radius) => sum + radius, 0) / Math.max(1, grains.radius.length);
  const mesh = new three.InstancedMesh(new three.CylinderGeometry(1, 1, 1, 8, 1, true), new three.MeshStandardMaterial({ roughness: 0.5 }), contacts.i.length);
  const [from, to, along, up] = [new three.Vector3(), new three.Vector3(), new three.Vector3(), new three.Vector3(0, 1, 0)];
  const turn = new three.Quaternion();
  const matrix = new three.Matrix4();
  const color = new three.Color();
  const reach = Math.min(...[0, 1, 2].map((k) => (cell.max[k] ?? 1) - (cell.min[k] ?? 0))) / 2;
  let drawn = 0;
  contacts.i.forEach((i, k) => {
    const j = contacts.j[k]!;
    from.set(grains.x[i]!, grains.y[i]!, grains.z[i]!);
    to.set(grains.x[j]!, grains.y[j]!, grains.z[j]!);
    along.subVectors(to, from);
    const length = along.length();
    if (!(length > 0) || length > reach) return;
    const force = contacts.normal_force[k]!;
    const thickness = kThickest * meanRadius * Math.sqrt(Math.max(0, force) / largest);
    turn.setFromUnitVectors(up, along.multiplyScalar(1 / length));
    matrix.compose(from.add(to).multiplyScalar(0.5), turn, new three.Vector3(thickness, length, thickness));
    mesh.setMatrixAt(drawn, matrix);
    mesh.setColorAt(drawn, color.setRGB(...viridis(share(force)), three.SRGBColorSpace));
    ++drawn;
  });
  mesh.count = drawn;
  return mesh;
}

function box(cell: Grains["cell"]): three.LineSegments {
  const size = [0, 1, 2].map((k) => (cell.max[k] ?? 1) - (cell.min[k] ?? 0)) as [number, number, number];
  const edges = new three.LineSegments(new three.EdgesGeometry(new three.BoxGeometry(...size)), new three.LineBasicMaterial({ color: 0x8899aa }));
  edges.position.set(...([0, 1, 2].map((k) => ((cell.min[k] ?? 0) + (cell.max[k] ?? 1)) / 2) as [number, number, number]));
  return edges;
}
