# Run by YADE: yade -n -x -jN yade_triaxial.py PACKING OUT REPEAT RATE
# One drained triaxial test to 20 % at 0.5 MPa: linear contacts (E 1 GPa, ks/kn 0.25, 29 degrees) with rolling and twisting
# (stiffness and limit 0.13), 50 stages of 0.4 % strained at RATE [1/s] with damping 0.2 and settled with damping 0.9 until the
# unbalanced force is below 1e-3 and the lateral stresses within 1e-3. Compressed to 0.5 MPa at no more than 0.01/s: at 1/s, where that
# takes as many steps, what it leaves shifts the curves by a percent. REPEAT shifts the grains by parts in 1e9.
# Writes OUT: axial strain, volumetric strain (logarithmic, compression positive), stress ratio, steps so far, wall and
# processor time.
import random
import sys
import time

from yade import pack

packing, out, repeat, rate = sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
shift = random.Random(repeat)
spheres = pack.SpherePack()
with open(packing) as file:
    lengths = [float(word) for word in file.readline().split()[1:]]
    for line in file:
        words = [float(word) for word in line.split()]
        if words:
            at = [x * (1 + 1e-9 * shift.random() * (repeat > 0)) for x in words[:3]]
            spheres.add(Vector3(*at), words[3])
O.periodic = True
O.cell.hSize = Matrix3(lengths[0], 0, 0, 0, lengths[1], 0, 0, 0, lengths[2])
sand = O.materials.append(CohFrictMat(
    young=1e9, poisson=0.25, frictionAngle=math.radians(29), density=2650e3, isCohesive=False, alphaKr=0.13, alphaKtw=0.13,
    momentRotationLaw=True, etaRoll=0.13, etaTwist=0.13))
spheres.toSimulation(material=sand)
servo = PeriTriaxController(
    stressMask=7, goal=(-5e5, -5e5, -5e5), maxStrainRate=(0.01,) * 3, dynCell=True, maxUnbalanced=1e-3, relStressTol=1e-3,
    doneHook='O.pause()')
newton = NewtonIntegrator(damping=0.2)
O.engines = [
    ForceResetter(), InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom6D()], [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()],
        [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True, useIncrementalForm=True)]),
    GlobalStiffnessTimeStepper(timestepSafetyCoefficient=0.8), servo, newton]
start, cpu = time.time(), time.process_time()
O.dt = 1e-6
O.run()
O.wait()
zero = [servo.strain[k] for k in range(3)]
servo.stressMask = 3
servo.maxStrainRate = (1, 1, rate)
servo.doneHook = ''  # which would end each run at its first step, since the strain asked for is held while grains settle
goal, straining, left = 0.0, False, 0


def inspect():
    """Every 20 steps: settles once the axial strain is there; ends the run once it has settled, after 20 000 steps in any case."""
    global straining, left
    if straining:
        if servo.strain[2] <= goal + 1e-7:
            straining, newton.damping, left = False, 0.9, 1000
        return
    stress = getStress()
    held = max(abs(stress[k, k] + 5e5) for k in (0, 1)) < 5e2
    left -= 1
    if left == 0 or (held and unbalancedForce() < 1e-3):
        O.pause()


# Within the run: a call of O.run(20, wait=True) sleeps for 40 ms at a time.
O.engines += [PyRunner(command='inspect()', iterPeriod=20)]
with open(out, 'w') as file:
    for stage in range(1, 51):
        newton.damping, goal, straining = 0.2, zero[2] - 0.004 * stage, True
        servo.goal = (-5e5, -5e5, goal)
        O.run()
        O.wait()
        stress = getStress()
        strain = [servo.strain[k] - zero[k] for k in range(3)]
        ratio = 2 * stress[2, 2] / (stress[0, 0] + stress[1, 1])
        print(-strain[2], -sum(strain), ratio, O.iter, time.time() - start, time.process_time() - cpu, file=file)
