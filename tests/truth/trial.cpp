#include "truth/trial.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <ostream>
#include <sstream>
#include <stdexcept>

namespace hapticd::truth {
namespace {

struct Words {
  std::ostream& out;

  Words& operator<<(double value) {
    out << ' ' << value;
    return *this;
  }
  Words& operator<<(const Point& p) { return *this << p.x() << p.y() << p.z(); }
  Words& operator<<(const Material& m) {
    return *this << m.stiffness_N_per_m << m.damping_Ns_per_m << m.staticFriction << m.dynamicFriction
                 << m.popthrough_N;
  }
  Words& operator<<(const Eigen::Quaterniond& q) { return *this << q.x() << q.y() << q.z() << q.w(); }
};

std::istream& operator>>(std::istream& in, Point& p) {
  return in >> p.x() >> p.y() >> p.z();
}
std::istream& operator>>(std::istream& in, Material& m) {
  return in >> m.stiffness_N_per_m >> m.damping_Ns_per_m >> m.staticFriction >> m.dynamicFriction >>
         m.popthrough_N;
}
std::istream& operator>>(std::istream& in, Corner& c) {
  return in >> c.x() >> c.y() >> c.z();
}

void writeObject(std::ostream& out, const TrialObject& object) {
  Words words{out};
  out << "object";
  words << object.material;
  for (const Pose& pose : object.poses) {
    out << "\npose";
    words << pose.position_m << pose.rotation << pose.scale;
  }
  for (const Corner& v : object.vertices) {
    out << "\nvertex";
    words << Point(v.cast<double>());
  }
  for (const Corner& v : object.target) {
    out << "\ntarget";
    words << Point(v.cast<double>());
  }
  for (const auto& t : object.triangles) out << "\ntriangle " << t[0] << ' ' << t[1] << ' ' << t[2];
  if (!object.target.empty()) out << "\nmorph " << object.morphBegin << ' ' << object.morphEnd;
  out << '\n';
}

TrialObject& lastObject(Trial& trial) {
  if (trial.objects.empty()) throw std::runtime_error("a line of an object precedes the first 'object'");
  return trial.objects.back();
}

bool readObjectLine(const std::string& key, std::istream& in, Trial& trial) {
  if (key == "object") {
    TrialObject& object = trial.objects.emplace_back();
    object.poses.clear();
    in >> object.material;
  } else if (key == "pose") {
    Pose& pose = lastObject(trial).poses.emplace_back();
    in >> pose.position_m >> pose.rotation.x() >> pose.rotation.y() >> pose.rotation.z() >>
        pose.rotation.w() >> pose.scale;
  } else if (key == "vertex") {
    in >> lastObject(trial).vertices.emplace_back();
  } else if (key == "target") {
    in >> lastObject(trial).target.emplace_back();
  } else if (key == "triangle") {
    auto& t = lastObject(trial).triangles.emplace_back();
    in >> t[0] >> t[1] >> t[2];
  } else if (key == "morph") {
    in >> lastObject(trial).morphBegin >> lastObject(trial).morphEnd;
  } else {
    return false;
  }
  return true;
}

bool readSceneLine(const std::string& key, std::istream& in, Trial& trial) {
  if (key == "trial") {
    int sides = 0;
    in >> trial.seed >> trial.kind >> trial.worldUnitsPerMetre >> trial.toolRadius_m >> sides;
    trial.sides = static_cast<Sides>(sides);
  } else if (key == "plane") {
    TrialPlane& plane = trial.planes.emplace_back();
    in >> plane.normal >> plane.offset_m >> plane.material;
  } else if (key == "wall") {
    Wall& wall = trial.enclosure.emplace_back();
    in >> wall.normal >> wall.offset_m;
  } else if (key == "hip") {
    in >> trial.hips.emplace_back();
  } else {
    return false;
  }
  return true;
}

}  // namespace

bool Trial::isStatic() const {
  return std::none_of(objects.begin(), objects.end(),
                      [](const TrialObject& o) { return o.moves() || !o.target.empty(); });
}

std::size_t Trial::triangleCount() const {
  return std::accumulate(objects.begin(), objects.end(), std::size_t{0},
                         [](std::size_t n, const TrialObject& o) { return n + o.triangles.size(); });
}

void write(std::ostream& out, const Trial& trial) {
  out.precision(std::numeric_limits<double>::max_digits10);
  Words words{out};
  out << "trial " << trial.seed << ' ' << trial.kind;
  words << trial.worldUnitsPerMetre << trial.toolRadius_m << static_cast<int>(trial.sides);
  out << '\n';
  for (const TrialObject& object : trial.objects) writeObject(out, object);
  for (const TrialPlane& plane : trial.planes) {
    out << "plane";
    words << plane.normal << plane.offset_m << plane.material;
    out << '\n';
  }
  for (const Wall& wall : trial.enclosure) {
    out << "wall";
    words << wall.normal << wall.offset_m;
    out << '\n';
  }
  for (const Point& hip : trial.hips) {
    out << "hip";
    words << hip;
    out << '\n';
  }
}

Trial read(std::istream& in) {
  Trial trial;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    std::istringstream words(line);
    std::string key;
    if (!(words >> key) || key[0] == '#') continue;
    if ((!readSceneLine(key, words, trial) && !readObjectLine(key, words, trial)) || words.fail()) {
      throw std::runtime_error("line " + std::to_string(number) + " of the trial is malformed: " + line);
    }
  }
  return trial;
}

}  // namespace hapticd::truth
