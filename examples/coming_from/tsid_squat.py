"""The squat of 14_coming_from.py with TSID (tried: 1.7.1 with pin 3.4.0); needs no Poise."""

import sys

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid

DT, HOME = 0.002, {"hip_pitch": -0.35, "knee": 0.7, "ankle_pitch": -0.35}

robot = tsid.RobotWrapper(sys.argv[1], [], pin.JointModelFreeFlyer(), False)
model = robot.model()
model.armature[6:] = 0.02
q, v = pin.neutral(model), np.zeros(model.nv)
for joint, angle in HOME.items():
    for side in ("left", "right"):
        q[model.joints[model.getJointId(f"{side}_{joint}")].idx_q] = angle

problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
problem.computeProblemData(0.0, q, v)
data = problem.data()
start = robot.com(data).copy()

corners = np.array(
    [[-0.09, -0.09, 0.13, 0.13], [-0.055, 0.055, -0.055, 0.055], [-0.07, -0.07, -0.07, -0.07]]
)
contacts = []
for side in ("left", "right"):
    foot = f"{side}_foot"
    up = np.array([0.0, 0.0, 1.0])
    contact = tsid.Contact6d(foot, robot, foot, corners, up, 0.7, 0.0, 1000.0)
    contact.setKp(np.zeros(6))
    contact.setKd(20.0 * np.ones(6))
    contact.setReference(robot.framePosition(data, model.getFrameId(foot)))
    problem.addRigidContact(contact, 1e-5)
    contacts.append(contact)

com = tsid.TaskComEquality("com", robot)
com.setKp(100.0 * np.ones(3))
com.setKd(20.0 * np.ones(3))
problem.addMotionTask(com, 1.0, 1, 0.0)

pelvis = tsid.TaskSE3Equality("pelvis", robot, "pelvis_link")
pelvis.setKp(100.0 * np.ones(6))
pelvis.setKd(20.0 * np.ones(6))
pelvis.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
upright = tsid.TrajectorySample(12, 6)
upright.value(np.concatenate((np.zeros(3), np.eye(3).ravel())))
pelvis.setReference(upright)
problem.addMotionTask(pelvis, 1.0, 1, 0.0)

posture = tsid.TaskJointPosture("posture", robot)
posture.setKp(10.0 * np.ones(robot.na))
posture.setKd(6.3 * np.ones(robot.na))
home = tsid.TrajectorySample(robot.na)
home.value(q[7:])
posture.setReference(home)
problem.addMotionTask(posture, 1e-5, 1, 0.0)

limit = model.effortLimit[6:]
torques = tsid.TaskActuationBounds("torques", robot)
torques.setBounds(-limit, limit)
problem.addActuationTask(torques, 1.0, 0, 0.0)

solver = tsid.SolverHQuadProgFast("qp")
solver.resize(problem.nVar, problem.nEq, problem.nIn)
sample = tsid.TrajectorySample(3)
for k in range(round(1.5 / DT)):
    t = k * DT
    x = min(1.0, t)
    sample.value(start + (3 * x**2 - 2 * x**3) * np.array([0.0, 0.02, -0.05]))
    sample.derivative((6 * x - 6 * x**2) * np.array([0.0, 0.02, -0.05]))
    sample.second_derivative((6 - 12 * x) * (t < 1.0) * np.array([0.0, 0.02, -0.05]))
    com.setReference(sample)
    solution = solver.solve(problem.computeProblemData(t, q, v))
    torque = problem.getActuatorForces(solution)  # to the robot
    dv = problem.getAccelerations(solution)  # here it is integrated in place of a robot
    q = pin.integrate(model, q, DT * v + 0.5 * DT**2 * dv)
    v = v + DT * dv

moved = 1e3 * (robot.com(problem.data()) - start)
print(f"CoM moved by {moved[0]:.2f} {moved[1]:.2f} {moved[2]:.2f} mm")
for joint in ("left_hip_roll", "left_knee", "right_ankle_pitch"):
    print(f"{joint} {q[model.joints[model.getJointId(joint)].idx_q]:.4f} rad")
