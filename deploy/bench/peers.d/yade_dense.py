# Run by YADE: yade -n -x -jN yade_dense.py PACKING OUT STEPS
# Compresses a periodic packing isotropically to 0.5 MPa with the Hertz-Mindlin law and moments, writes its geometry to
# OUT.geometry ("n Lx Ly Lz dt", then "x y z r" per grain) if that is not there yet, then strains it by STEPS steps and
# writes OUT.json: contacts and steps, and the wall and processor time they took.
import json
import os
import random
import sys
import time

from yade import pack

packing, out, steps = sys.argv[1], sys.argv[2], int(sys.argv[3])
with open(packing) as file:
    lengths = [float(word) for word in file.readline().split()[1:]]
spheres = pack.SpherePack()
spheres.load(packing)
O.periodic = True
O.cell.hSize = Matrix3(lengths[0], 0, 0, 0, lengths[1], 0, 0, 0, lengths[2])
sand = O.materials.append(FrictMat(young=7e9, poisson=0.2, frictionAngle=math.atan(0.5), density=2650e3))
spheres.toSimulation(material=sand)


def engines(more):
    law = InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_MindlinPhys(krot=0.7, ktwist=0.7, eta=0.13)],
        [Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=True)])
    return [ForceResetter(), InsertionSortCollider([Bo1_Sphere_Aabb()]), law] + more + [NewtonIntegrator(damping=0.2)]


servo = PeriTriaxController(
    stressMask=7, goal=(-5e5, -5e5, -5e5), maxStrainRate=(1, 1, 1), dynCell=True, maxUnbalanced=2e-3,
    relStressTol=2e-3, doneHook='O.pause()')
O.engines = engines([GlobalStiffnessTimeStepper(timestepSafetyCoefficient=0.8), servo])
O.dt = 1e-6
O.run()
O.wait()
step = O.dt
O.engines = engines([])
O.dt = step
if not os.path.exists(out + '.geometry'):
    with open(out + '.geometry', 'w') as file:
        size = O.cell.hSize.diagonal()
        print(len(O.bodies), size[0], size[1], size[2], step, file=file)
        for body in O.bodies:
            at = O.cell.wrap(body.state.pos)
            print(at[0], at[1], at[2], body.shape.radius, file=file)
O.cell.velGrad = Matrix3(0.055, 0, 0, 0, 0.055, 0, 0, 0, -0.1)
O.run(50, True)
before = sum(1 for i in O.interactions)
start, cpu = time.time(), time.process_time()
O.run(steps, True)
wall, cpu = time.time() - start, time.process_time() - cpu
after = sum(1 for i in O.interactions)
with open(out + '.json', 'w') as file:
    json.dump({'contacts': 0.5 * (before + after), 'steps': steps, 'wall': wall, 'cpu': cpu}, file)
