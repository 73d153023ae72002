// The motion of robots in space.
#include <utility>

#include "bindings.hpp"
#include "quasilpv/kinematic_tree.hpp"

namespace quasilpv::bindings {
namespace {

py::array_t<double> to_numpy(const TreeMatrix& matrix) {
  py::array_t<double> result({matrix.rows(), matrix.cols()});
  auto entries = result.mutable_unchecked<2>();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      entries(row, column) = matrix(row, column);
    }
  }
  return result;
}

/// Of a tree: every argument is checked for its size.
class BoundTree {
 public:
  explicit BoundTree(const py::handle& document)
      : document_(to_json(document)), dynamics_(read_tree(Field(document_, "tree", ""))) {}

  int joints() const { return dynamics_.joints(); }

  py::array_t<double> torque_at_rest(const DoubleArray& q, const DoubleArray& a) const {
    const JointArray at = array(q, "coordinate");
    const JointArray acceleration = array(a, "acceleration");
    JointArray torque{};
    dynamics_.torque_at_rest(at.data(), acceleration.data(), torque.data());
    return bindings::to_numpy(torque, joints());
  }

  py::array_t<double> inverse_dynamics(const DoubleArray& q, const DoubleArray& w, const DoubleArray& a) const {
    const JointArray at = array(q, "coordinate");
    const JointArray speed = array(w, "speed");
    const JointArray acceleration = array(a, "acceleration");
    JointArray torque{};
    dynamics_.inverse_dynamics(at.data(), speed.data(), acceleration.data(), torque.data());
    return bindings::to_numpy(torque, joints());
  }

  py::array_t<double> inertia(const DoubleArray& q) const {
    return to_numpy(dynamics_.inertia(array(q, "coordinate").data()));
  }

  std::pair<py::array_t<double>, py::array_t<double>> derivatives(const DoubleArray& q, const DoubleArray& w,
                                                                  const DoubleArray& a) const {
    TreeMatrix by_coordinate;
    TreeMatrix by_speed;
    dynamics_.derivatives(array(q, "coordinate").data(), array(w, "speed").data(), array(a, "acceleration").data(),
                          by_coordinate, by_speed);
    return {to_numpy(by_coordinate), to_numpy(by_speed)};
  }

  double energy(const DoubleArray& q, const DoubleArray& w) const {
    return dynamics_.energy(array(q, "coordinate").data(), array(w, "speed").data());
  }

 private:
  JointArray array(const DoubleArray& values, const char* name) const { return to_joint_array(values, joints(), name); }

  Json document_;
  TreeDynamics dynamics_;
};

}  // namespace

void bind_tree(py::module_& module) {
  py::class_<BoundTree>(module, "Tree", "The motion of a robot in space, as the run-time side computes it.")
      .def(py::init<const py::handle&>(), py::arg("document"), "From a document of kind `tree`.")
      .def_property_readonly("joints", &BoundTree::joints)
      .def("torque_at_rest", &BoundTree::torque_at_rest, py::arg("coordinate"), py::arg("acceleration"),
           "M(q) a + G(q), N m, shape (joints,).")
      .def("inverse_dynamics", &BoundTree::inverse_dynamics, py::arg("coordinate"), py::arg("speed"),
           py::arg("acceleration"), "M(q) a + h(q, w), N m, shape (joints,).")
      .def("inertia", &BoundTree::inertia, py::arg("coordinate"), "M(q), kg m^2, shape (joints, joints).")
      .def("derivatives", &BoundTree::derivatives, py::arg("coordinate"), py::arg("speed"), py::arg("acceleration"),
           "Of inverse_dynamics with respect to coordinates and speeds, two arrays of shape (joints, joints).")
      .def("energy", &BoundTree::energy, py::arg("coordinate"), py::arg("speed"), "Kinetic plus potential, J.");
}

}  // namespace quasilpv::bindings
