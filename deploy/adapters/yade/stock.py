# Drained triaxial test on a periodic packing of spheres:  yade -n -x -j1 stock.py
import sys
from yade import pack

young, friction_angle = 0.12e9, radians(26.565)  # normal stiffness 2 E r1 r2/(r1 + r2)
rolling_stiffness, rolling_friction = 0, 0  # YADE's alphaKr and etaRoll
stiffness_ratio = 0.6  # shear to normal stiffness; CohFrictMat takes it as "poisson"
pressure, packing = 0.5e6, 'packing_1000.txt'  # first line: ##PERIODIC:: Lx Ly Lz
strains = [0.005 * k for k in range(21)]  # logarithmic, compression positive
lateral_mask, lateral_goal = 3, -pressure  # x and y keep their stress (0, 0: their strain)
rate, at_rest, patience = 0.1, 5e-4, 40000  # 1/s; unbalanced force; steps until given up

O.periodic = True
O.cell.hSize = Vector3(*map(float, open(packing).readline().split()[1:])).asDiagonal()
spheres = pack.SpherePack()
spheres.load(packing)
spheres.toSimulation(material=CohFrictMat(
    young=young, poisson=stiffness_ratio, frictionAngle=friction_angle, density=2650e3,
    isCohesive=False, momentRotationLaw=True, alphaKr=rolling_stiffness, alphaKtw=0,
    etaRoll=rolling_friction))
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom6D()], [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()],
                    [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(
                        always_use_moment_law=True, useIncrementalForm=True)]),
    GlobalStiffnessTimeStepper(timestepSafetyCoefficient=0.8),
    PeriTriaxController(label='triax', dynCell=True, maxUnbalanced=at_rest, relStressTol=1e-3),
    NewtonIntegrator(label='newton')]
O.dt = 1e-6


def reach(mask, goal, rates, moving):
    """Move for some steps with little damping, then with much until the goal is met at rest."""
    triax.stressMask, triax.goal, triax.maxStrainRate = mask, goal, rates
    newton.damping, triax.doneHook = 0.2, ''
    if moving > 0:
        O.run(moving, True)
    newton.damping, triax.doneHook = 0.9, 'O.pause()'
    start = O.iter
    O.run(patience, True)
    if O.iter - start >= patience:
        print('no equilibrium after', patience, 'steps at strain', triax.strain, file=sys.stderr)
        sys.exit(1)


reach(7, (-pressure, -pressure, -pressure), (1, 1, 1), 0)
O.cell.trsf = Matrix3.Identity  # strains start here
print('axial_strain volumetric_strain axial_stress lateral_stress void_ratio')
for strain in strains:
    moving = int(abs(strain + triax.strain[2]) / (rate * O.dt))
    reach(lateral_mask, (lateral_goal, lateral_goal, -strain), (1, 1, rate), moving)
    stress = -getStress().diagonal()
    lateral = (stress[0] + stress[1]) / 2
    void_ratio = porosity() / (1 - porosity())
    print(-triax.strain[2], -sum(triax.strain), stress[2], lateral, void_ratio, flush=True)
