// SPDX-License-Identifier: BSD-3-Clause
// Poses, rotations and points as Python values.
#include <cstddef>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include <fmt/core.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/point.hpp"
#include "cairn/typed/pose2.hpp"
#include "cairn/typed/pose3.hpp"
#include "cairn/typed/rot3.hpp"

namespace cairn::python {
namespace {

template <class Matrix>
py::array_t<double> array_of_vector(const Matrix& v) {
  return array_of({v.data(), static_cast<std::size_t>(v.size())});
}
template <class Matrix>
py::array_t<double> array_of_matrix(const Matrix& A) {
  py::array_t<double> array({A.rows(), A.cols()});
  double* out = array.mutable_data();
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    for (Eigen::Index column = 0; column < A.cols(); ++column) *out++ = A(row, column);
  }
  return array;
}

/// N numbers as a vector, of any sequence.
template <int N>
Vector<double, N> vector_of(const py::object& sequence, const char* what) {
  return detail::sized<N>(what, span_of(doubles_of(sequence, what)));
}

/// A square matrix of any nested sequence.
template <int N>
Eigen::Matrix<double, N, N> matrix_of(const py::object& sequence, const char* what) {
  const Doubles numbers = doubles_of(sequence, what);
  if (numbers.ndim() != 2 || numbers.shape(0) != N || numbers.shape(1) != N) {
    throw Error(ErrorCode::usage, fmt::format("{}: the shape is {}, expected ({}, {})", what,
                                              shape_text(numbers), N, N));
  }
  Eigen::Matrix<double, N, N> A;
  for (int row = 0; row < N; ++row) {
    for (int column = 0; column < N; ++column) A(row, column) = numbers.data()[row * N + column];
  }
  return A;
}

/// A function of points applied to each row of an array (N,) or (n, N).
template <int N, class Function>
py::array_t<double> each_point(const py::object& points, const Function& function) {
  const Doubles in = doubles_of(points, "points");
  if ((in.ndim() != 1 && in.ndim() != 2) || in.shape(in.ndim() - 1) != N) {
    throw Error(ErrorCode::usage, fmt::format("points: the shape is {}, expected ({},) or (n, {})",
                                              shape_text(in), N, N));
  }
  py::array_t<double> out(std::vector<py::ssize_t>(in.shape(), in.shape() + in.ndim()));
  for (py::ssize_t k = 0; k < in.size(); k += N) {
    const BasicPoint<double, N> moved =
        function(BasicPoint<double, N>(detail::load<N>(in.data() + k)));
    for (int i = 0; i < N; ++i) out.mutable_data()[k + i] = moved[i];
  }
  return out;
}

template <class T>
std::vector<double> numbers_of(const T& value) {
  const auto& state = value.state();
  return {state.data(), state.data() + state.size()};
}

/// What all values have: the numbers of their state, text, copies and pickles.
template <class T, class Class>
void bind_value(Class& type) {
  type.def_property_readonly(
          "state", [](const T& value) { return array_of_vector(value.state()); },
          "The numbers that a graph stores, as a copy.")
      .def_static(
          "from_state",
          [](const py::object& state) {
            return T::from_state(span_of(doubles_of(state, T::kName)));
          },
          py::arg("state"), "The value that a graph stores as these numbers.")
      .def(
          "equals", [](const T& a, const T& b, double tolerance) { return a.equals(b, tolerance); },
          py::arg("other"), py::arg("tolerance") = 1e-9,
          "Whether no coordinate of the difference is beyond the tolerance [m, rad].")
      .def(
          "__eq__", [](const T& a, const T& b) { return numbers_of(a) == numbers_of(b); },
          py::is_operator(), "Whether all numbers of the state are the same, exactly.")
      .def("__hash__",
           [](const T& value) { return py::hash(py::tuple(py::cast(numbers_of(value)))); })
      .def("__repr__", [](const T& value) { return to_string(value); })
      .def("__copy__", [](const T& value) { return value; })
      .def("__deepcopy__", [](const T& value, const py::dict&) { return value; })
      .def(
          "__array__",
          [](const T& value, const py::object& dtype, const py::object&) -> py::object {
            const py::array_t<double> array = array_of_vector(value.state());
            return dtype.is_none() ? py::object(array) : array.attr("astype")(dtype);
          },
          py::arg("dtype") = py::none(), py::arg("copy") = py::none())
      .def(py::pickle([](const T& value) { return py::make_tuple(array_of_vector(value.state())); },
                      [](const py::tuple& state) {
                        return T::from_state(span_of(doubles_of(state[0], T::kName)));
                      }));
}

/// What all elements of Lie groups have.
template <class T, class Class>
void bind_group(Class& type) {
  bind_value<T>(type);
  type.def_static(
          "exp",
          [](const py::object& delta) { return T::exp(vector_of<T::kTangent>(delta, "delta")); },
          py::arg("delta"),
          "The group element of a tangent vector: translation first, then rotation.")
      .def(
          "log", [](const T& value) { return array_of_vector(value.log()); },
          "The tangent vector with exp(log()) = self, of least rotation.")
      .def("inverse", &T::inverse)
      .def("between", &T::between, py::arg("other"),
           "self.inverse() * other: the other as seen from here.")
      .def(
          "retract",
          [](const T& value, const py::object& delta) {
            return value.retract(vector_of<T::kTangent>(delta, "delta"));
          },
          py::arg("delta"), "self * exp(delta): a step in the frame of the body.")
      .def(
          "local", [](const T& a, const T& b) { return array_of_vector(a.local(b)); },
          py::arg("other"), "The tangent vector with self.retract(local(other)) = other.")
      .def(
          "adjoint", [](const T& value) { return array_of_matrix(value.adjoint()); },
          "Ad, tangent x tangent: self exp(delta) self.inverse() = exp(Ad delta).")
      .def(
          "matrix", [](const T& value) { return array_of_matrix(value.matrix()); },
          "The rotation matrix of a rotation; of a pose the homogeneous matrix [R t; 0 1].")
      .def(py::self * py::self);
}

template <class T, class Point, class Class>
void bind_pose(Class& type) {
  constexpr int kDimension = Point::SizeAtCompileTime;
  bind_group<T>(type);
  type.def(
          "__mul__", [](const T& pose, const Point& point) { return pose.transform_from(point); },
          py::is_operator())
      .def_property_readonly(
          "translation", [](const T& pose) { return array_of_vector(pose.translation().state()); },
          "Position [m].")
      .def(
          "transform_from",
          [](const T& pose, const py::object& points) {
            return each_point<kDimension>(points,
                                          [&](const Point& p) { return pose.transform_from(p); });
          },
          py::arg("points"),
          "R p + t: points of the body's frame, in the world; one, or an array with a row for "
          "each.")
      .def(
          "transform_to",
          [](const T& pose, const py::object& points) {
            return each_point<kDimension>(points,
                                          [&](const Point& p) { return pose.transform_to(p); });
          },
          py::arg("points"), "The inverse: points of the world, in the body's frame.");
}

template <class Point, class Class>
void bind_point(Class& type) {
  bind_value<Point>(type);
  type.def(
          "__add__", [](const Point& a, const Point& b) { return Point(a + b); }, py::is_operator())
      .def(
          "__sub__", [](const Point& a, const Point& b) { return Point(a - b); }, py::is_operator())
      .def_property_readonly("x", [](const Point& p) { return p[0]; })
      .def_property_readonly("y", [](const Point& p) { return p[1]; });
}

void bind_plane(py::module_& module) {
  py::class_<Point2> point(module, "Point2", "A point of the plane, x y [m]; VERTEX_XY in files.");
  point.attr("tag") = std::string(Point2::Traits::kTag);
  point.def(py::init<>()).def(py::init<double, double>(), py::arg("x"), py::arg("y"));
  bind_point<Point2>(point);

  py::class_<Pose2> pose(module, "Pose2",
                         R"(A pose in the plane: x y [m], theta [rad]; VERTEX_SE2 in files.

Where a body is in the world, or where one body is as seen from another. Tangent vectors are (forward [m], left [m], turn
[rad]). `a * b` composes, `a * point` takes a point of the body's frame to the world.)");
  pose.attr("tag") = std::string(Pose2::Traits::kTag);
  pose.def(py::init<>())
      .def(py::init<double, double, double>(), py::arg("x"), py::arg("y"), py::arg("theta"))
      .def_property_readonly("x", [](const Pose2& p) { return p.x(); })
      .def_property_readonly("y", [](const Pose2& p) { return p.y(); })
      .def_property_readonly("theta", [](const Pose2& p) { return p.theta(); });
  bind_pose<Pose2, Point2>(pose);
}

void bind_space(py::module_& module) {
  py::class_<Point3> point(module, "Point3",
                           "A point of space, x y z [m]; VERTEX_TRACKXYZ in files.");
  point.attr("tag") = std::string(Point3::Traits::kTag);
  point.def(py::init<>())
      .def(py::init<double, double, double>(), py::arg("x"), py::arg("y"), py::arg("z"))
      .def_property_readonly("z", [](const Point3& p) { return p[2]; });
  bind_point<Point3>(point);

  py::class_<Rot3> rotation(module, "Rot3",
                            "A rotation of space: a unit quaternion; its tangent vector is the "
                            "rotation vector [rad].");
  rotation.def(py::init<>())
      .def_static(
          "from_roll_pitch_yaw",
          [](double roll, double pitch, double yaw) {
            return Rot3::roll_pitch_yaw(roll, pitch, yaw);
          },
          py::arg("roll"), py::arg("pitch"), py::arg("yaw"), "R_z(yaw) R_y(pitch) R_x(roll) [rad].")
      .def_static(
          "yaw", [](double angle) { return Rot3::yaw(angle); }, py::arg("angle"),
          "A turn about the z axis [rad].")
      .def_static(
          "from_quaternion",
          [](double x, double y, double z, double w) {
            return Rot3(Eigen::Quaterniond(w, x, y, z));
          },
          py::arg("x"), py::arg("y"), py::arg("z"), py::arg("w"), "Normalized here.")
      .def_static(
          "from_matrix", [](const py::object& R) { return Rot3(matrix_of<3>(R, "matrix")); },
          py::arg("R"), "The rotation nearest to a 3 x 3 matrix that is one but for rounding.")
      .def_property_readonly(
          "quaternion", [](const Rot3& R) { return array_of_vector(R.state()); }, "x y z w.")
      .def_property_readonly(
          "roll_pitch_yaw", [](const Rot3& R) { return array_of_vector(R.roll_pitch_yaw()); },
          "[rad], pitch within -pi/2 and pi/2.");
  bind_group<Rot3>(rotation);
  rotation.def(
      "__mul__", [](const Rot3& R, const Point3& p) { return R * p; }, py::is_operator(),
      "R p: a point, or a direction, turned.");

  py::class_<Pose3> pose(module, "Pose3",
                         R"(A pose in space: x y z [m] and a rotation; VERTEX_SE3:QUAT in files.

Its state is x y z and a unit quaternion qx qy qz qw; its tangent vectors are translation [m], then rotation vector
[rad], both in the frame of the body. `a * b` composes, `a * point` takes a point of the body's frame to the world.)");
  pose.attr("tag") = std::string(Pose3::Traits::kTag);
  pose.def(py::init<>())
      .def(py::init([](const Rot3& R, const py::object& t) {
             return Pose3(R, Point3(vector_of<3>(t, "translation")));
           }),
           py::arg("rotation"), py::arg("translation"))
      .def_static(
          "from_matrix", [](const py::object& T) { return Pose3(matrix_of<4>(T, "matrix")); },
          py::arg("T"), "From a homogeneous matrix [R t; 0 1].")
      .def_property_readonly("x", [](const Pose3& p) { return p.x(); })
      .def_property_readonly("y", [](const Pose3& p) { return p.y(); })
      .def_property_readonly("z", [](const Pose3& p) { return p.z(); })
      .def_property_readonly("rotation", &Pose3::rotation);
  bind_pose<Pose3, Point3>(pose);
}

}  // namespace

void bind_values(py::module_& module) {
  bind_plane(module);
  bind_space(module);
}

}  // namespace cairn::python
