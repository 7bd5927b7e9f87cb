# Run by YADE: yade -n -x -j1 yade_curves.py JOB.json
# One drained triaxial or oedometric test in a periodic cell. JOB holds: law (mindlin | linear), young [Pa], poisson (ks/kn for
# linear), friction (coefficient), rolling (absent, or [stiffness in N m/rad, limit in mean radii]), packing (file), drained
# (lateral stresses held; else lateral strains), pressure [Pa], strains (axial, logarithmic, from the end of consolidation), out.
# Staging: `rate` [1/s] in stages of at most 0.002 with damping 0.2, each settled with damping 0.9 until the unbalanced force is below
# 5e-4 and held stresses within 1e-3; compressed to the pressure at no more than 0.01/s (yade_triaxial.py says why). Writes to out,
# a line per strain: axial strain, volumetric strain (both logarithmic, compression positive), axial stress, lateral stress [Pa].
import json
import sys

from yade import pack

with open(sys.argv[1]) as file:
    job = json.load(file)
spheres = pack.SpherePack()
with open(job["packing"]) as file:
    lengths = [float(word) for word in file.readline().split()[1:]]
    for line in file:
        words = [float(word) for word in line.split()]
        if words:
            spheres.add(Vector3(*words[:3]), words[3])
O.periodic = True
O.cell.hSize = Matrix3(lengths[0], 0, 0, 0, lengths[1], 0, 0, 0, lengths[2])
sand = O.materials.append(FrictMat(
    young=job["young"], poisson=job["poisson"], frictionAngle=math.atan(job["friction"]), density=2650e3))
spheres.toSimulation(material=sand)
moments = job.get("rolling")
if job["law"] == "linear":
    physics, law = Ip2_FrictMat_FrictMat_FrictPhys(), Law2_ScGeom_FrictPhys_CundallStrack()
elif moments:
    physics = Ip2_FrictMat_FrictMat_MindlinPhys(krot=moments[0], eta=moments[1])
    law = Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=True)
else:
    physics, law = Ip2_FrictMat_FrictMat_MindlinPhys(), Law2_ScGeom_MindlinPhys_Mindlin()
pressure = job["pressure"]
servo = PeriTriaxController(
    stressMask=7, goal=(-pressure,) * 3, maxStrainRate=(0.01,) * 3, dynCell=True, maxUnbalanced=5e-4, relStressTol=1e-3,
    doneHook='O.pause()')
newton = NewtonIntegrator(damping=0.2)
O.engines = [
    ForceResetter(), InsertionSortCollider([Bo1_Sphere_Aabb()]), InteractionLoop([Ig2_Sphere_Sphere_ScGeom()], [physics], [law]),
    GlobalStiffnessTimeStepper(timestepSafetyCoefficient=0.8), servo, newton]
O.dt = 1e-6
O.run()
O.wait()
zero = [servo.strain[k] for k in range(3)]
drained = job["drained"]
servo.stressMask = 3 if drained else 0
servo.maxStrainRate = (1, 1, job["rate"])
servo.doneHook = ''  # which would end each run at its first step, since the strain asked for is held while grains settle
sides = (-pressure, -pressure) if drained else (zero[0], zero[1])


goal_strain, straining, left = 0.0, False, 0


def inspect():
    """Every 20 steps: settles once the axial strain is there; ends the run once it has settled, after 20 000 steps in any case."""
    global straining, left
    if straining:
        if abs(servo.strain[2] - goal_strain) <= 1e-7:
            straining, newton.damping, left = False, 0.9, 1000
        return
    stress = getStress()
    held = not drained or max(abs(stress[k, k] + pressure) for k in (0, 1)) < 1e-3 * pressure
    left -= 1
    if left == 0 or (held and unbalancedForce() < 5e-4):
        O.pause()


# Within the run: a call of O.run(20, wait=True) sleeps for 40 ms at a time.
O.engines += [PyRunner(command='inspect()', iterPeriod=20)]


def walk_to(goal):
    """Strains to the axial strain and settles there; the stress tensor."""
    global goal_strain, straining
    newton.damping, goal_strain, straining = 0.2, goal, True
    servo.goal = (*sides, goal)
    O.run()
    O.wait()
    return getStress()


with open(job["out"], "w") as file:
    at = 0.0
    stress = getStress()
    for target in job["strains"]:
        stages = max(1, math.ceil(abs(target - at) / 0.002 - 1e-6))
        for stage in range(1, stages + 1):
            if target != at:
                stress = walk_to(zero[2] - (at + (target - at) * stage / stages))
        at = target
        strain = [servo.strain[k] - zero[k] for k in range(3)]
        print(-strain[2], -sum(strain), -stress[2, 2], -0.5 * (stress[0, 0] + stress[1, 1]), file=file)
