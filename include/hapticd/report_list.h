// The one list of report kinds. Counters, names and callback lists are derived from it.
#pragma once

// X(enumerator of ReportKind, struct without "Report", name for people). Append only: the order is that of
// ReportKind.
#define HAPTICD_REPORTS(X)                          \
  X(pose, Pose, "pose")                             \
  X(velocity, Velocity, "velocity")                 \
  X(acceleration, Acceleration, "acceleration")     \
  X(button, Button, "button")                       \
  X(analog, Analog, "analog")                       \
  X(force, Force, "force")                          \
  X(depth, Depth, "depth")                          \
  X(contactPoint, ContactPoint, "contact point")    \
  X(touching, Touching, "touching")                 \
  X(touchedObject, TouchedObject, "touched object") \
  X(angle, Angle, "angle")                          \
  X(forceError, ForceError, "force error")          \
  X(text, Text, "text")                             \
  X(toRoom, ToRoom, "to room")                      \
  X(unitToSensor, UnitToSensor, "unit to sensor")   \
  X(workspace, Workspace, "workspace")              \
  X(tick, Tick, "tick")                             \
  X(contacts, Contacts, "contacts")                 \
  X(guard, Guard, "guard")                          \
  X(hand, Hand, "hand")
