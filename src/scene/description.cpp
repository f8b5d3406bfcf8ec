#include "scene/description.h"

#include "scene/free_forces.h"
#include "scene/object_table.h"

namespace hapticd::scene {

void ObjectTable::describe(SceneDescription& out) const {
  out.T_world_scene = T_world_scene_;
  for (const auto& object : objects_) {
    if (!object) continue;
    ObjectDescription& to = out.objects.emplace_back();
    to.id = object->id;
    to.parent = object->parent;
    to.touchable = object->touchable;
    to.name = object->name;
    to.worldUnits = object->worldUnits();
    to.T_world_object = frameOf(*object) * Eigen::UniformScaling<double>(object->worldUnits());
    to.T_parent_object = object->T_parent_object;
    to.T_object_mesh = object->T_object_mesh;
    to.surface = object->surface;
    if (const MeshGeometry* mesh = object->geometry.get()) {
      to.vertices = mesh->target ? mesh->target : mesh->vertices;
      to.triangles = mesh->triangles;
    }
  }
}

void FreeForces::describe(SceneDescription& out) const {
  for (const auto& [index, entry] : effects_) {
    out.effects.push_back({entry.value.effect, entry.value.running});
  }
  for (const auto& [index, entry] : planes_) out.planes.push_back(entry.value);
  if (field_) out.fields.push_back(field_->value);
  if (!constraint_ || !constraint_->value.enabled) return;
  const Constraint& c = constraint_->value;
  const auto add = [&](std::string_view mode, const Vec3& point_m, const Vec3& direction) {
    out.constraint = {mode, kWorldUnitsPerStockMetre * point_m, direction, c.stiffness_N_per_m};
  };
  if (c.mode == 1) add("point", c.point_m, Vec3::Zero());
  if (c.mode == 2) add("line", c.linePoint_m, c.lineDirection);
  if (c.mode == 3) add("plane", c.planePoint_m, c.planeNormal);
}

}  // namespace hapticd::scene
