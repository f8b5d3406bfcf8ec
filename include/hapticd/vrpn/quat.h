// Quaternions, vectors and 4x4 matrices under the names of VRPN's quaternion library. Quaternions are x y z w
// and act from the left: q_mult(d, a, b) rotates by b, then by a. Results may be an argument.
#ifndef Q_INCLUDED
#define Q_INCLUDED

#include <math.h>
#include <stdio.h>
#include <string.h>

#define Q_X 0
#define Q_Y 1
#define Q_Z 2
#define Q_W 3
#define Q_YAW 0
#define Q_PITCH 1
#define Q_ROLL 2
#define Q_EPSILON (1e-10)
#define Q_PI 3.14159265358979323846
#define Q_MAX(x, y) (((x) > (y)) ? (x) : (y))
#define Q_MIN(x, y) (((x) < (y)) ? (x) : (y))
#define Q_ABS(x) (((x) > 0) ? (x) : (-(x)))
#define Q_DEG_TO_RAD(deg) (((deg)*Q_PI) / 180.0)
#define Q_RAD_TO_DEG(rad) (((rad)*180.0) / Q_PI)
#define Q_NULL_VECTOR \
  { 0.0, 0.0, 0.0 }
#define Q_ID_QUAT \
  { 0.0, 0.0, 0.0, 1.0 }
#define Q_ID_MATRIX                                                     \
  {                                                                     \
    {1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}, { \
      0.0, 0.0, 0.0, 1.0                                                \
    }                                                                   \
  }

typedef double q_type[4];
typedef double q_vec_type[3];
typedef double q_matrix_type[4][4];
typedef double qogl_matrix_type[16];
typedef float qgl_matrix_type[4][4];

typedef struct q_xyz_quat_struct {
  q_vec_type xyz;
  q_type quat;
} q_xyz_quat_type;

// --- vectors

inline void q_vec_set(q_vec_type to, double x, double y, double z) {
  to[0] = x;
  to[1] = y;
  to[2] = z;
}
inline void q_vec_copy(q_vec_type to, const q_vec_type from) {
  memmove(to, from, sizeof(q_vec_type));
}
inline void q_vec_add(q_vec_type to, const q_vec_type a, const q_vec_type b) {
  for (int i = 0; i < 3; ++i) to[i] = a[i] + b[i];
}
inline void q_vec_subtract(q_vec_type to, const q_vec_type a, const q_vec_type b) {
  for (int i = 0; i < 3; ++i) to[i] = a[i] - b[i];
}
inline double q_vec_dot_product(const q_vec_type a, const q_vec_type b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline void q_vec_scale(q_vec_type to, double factor, const q_vec_type from) {
  for (int i = 0; i < 3; ++i) to[i] = factor * from[i];
}
inline void q_vec_invert(q_vec_type to, const q_vec_type from) {
  q_vec_scale(to, -1, from);
}
inline double q_vec_magnitude(const q_vec_type v) {
  return sqrt(q_vec_dot_product(v, v));
}
inline double q_vec_distance(const q_vec_type a, const q_vec_type b) {
  q_vec_type difference;
  q_vec_subtract(difference, a, b);
  return q_vec_magnitude(difference);
}
/// A vector without length prints an error and leaves the result as it was.
inline void q_vec_normalize(q_vec_type to, const q_vec_type from) {
  const double length = q_vec_magnitude(from);
  if (length < Q_EPSILON) {
    fprintf(stderr, "VRPN: q_vec_normalize() of a vector without length\n");
    return;
  }
  q_vec_scale(to, 1 / length, from);
}
inline void q_vec_cross_product(q_vec_type to, const q_vec_type a, const q_vec_type b) {
  q_vec_set(to, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}
inline void q_vec_print(const q_vec_type v) {
  printf("(%g, %g, %g)\n", v[0], v[1], v[2]);
}

// --- quaternions

inline void q_copy(q_type to, const q_type from) {
  memmove(to, from, sizeof(q_type));
}
inline void q_print(const q_type q) {
  printf("[(%g, %g, %g), %g]\n", q[Q_X], q[Q_Y], q[Q_Z], q[Q_W]);
}
/// Angles in radians; an axis without length is no rotation.
inline void q_from_axis_angle(q_type to, double x, double y, double z, double angle) {
  const double length = sqrt(x * x + y * y + z * z);
  const double factor = length < Q_EPSILON ? 0 : sin(angle / 2) / length;
  to[Q_X] = factor * x;
  to[Q_Y] = factor * y;
  to[Q_Z] = factor * z;
  to[Q_W] = length < Q_EPSILON ? 1 : cos(angle / 2);
}
inline void q_make(q_type to, double x, double y, double z, double angle) {
  q_from_axis_angle(to, x, y, z, angle);
}
inline void q_normalize(q_type to, const q_type from) {
  const double length = sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2] + from[3] * from[3]);
  for (int i = 0; i < 4; ++i) to[i] = from[i] / length;
}
/// The angle is 0 to 2 pi; without rotation it is 0 about z.
inline void q_to_axis_angle(double* x, double* y, double* z, double* angle, const q_type q) {
  const double length = q_vec_magnitude(q);
  *angle = length > Q_EPSILON ? 2 * atan2(length, q[Q_W]) : 0;
  *x = length > Q_EPSILON ? q[Q_X] / length : 0;
  *y = length > Q_EPSILON ? q[Q_Y] / length : 0;
  *z = length > Q_EPSILON ? q[Q_Z] / length : 1;
}
inline void q_conjugate(q_type to, const q_type from) {
  q_vec_invert(to, from);
  to[Q_W] = from[Q_W];
}
inline void q_invert(q_type to, const q_type from) {
  const double square = from[0] * from[0] + from[1] * from[1] + from[2] * from[2] + from[3] * from[3];
  q_conjugate(to, from);
  for (int i = 0; i < 4; ++i) to[i] /= square;
}
inline void q_mult(q_type to, const q_type a, const q_type b) {
  const q_type product = {a[Q_W] * b[Q_X] + a[Q_X] * b[Q_W] + a[Q_Y] * b[Q_Z] - a[Q_Z] * b[Q_Y],
                          a[Q_W] * b[Q_Y] + a[Q_Y] * b[Q_W] + a[Q_Z] * b[Q_X] - a[Q_X] * b[Q_Z],
                          a[Q_W] * b[Q_Z] + a[Q_Z] * b[Q_W] + a[Q_X] * b[Q_Y] - a[Q_Y] * b[Q_X],
                          a[Q_W] * b[Q_W] - a[Q_X] * b[Q_X] - a[Q_Y] * b[Q_Y] - a[Q_Z] * b[Q_Z]};
  q_copy(to, product);
}
/// Of unit quaternions: half the angle along the axis.
inline void q_log(q_type to, const q_type from) {
  const double length = q_vec_magnitude(from);
  const double factor = length > Q_EPSILON ? atan2(length, from[Q_W]) / length : 1;
  q_vec_scale(to, factor, from);
  to[Q_W] = 0;
}
inline void q_exp(q_type to, const q_type from) {
  const double angle = q_vec_magnitude(from);
  const double factor = angle > Q_EPSILON ? sin(angle) / angle : 1;
  q_vec_scale(to, factor, from);
  to[Q_W] = cos(angle);
}
/// From `start` (t = 0) to `end` (t = 1) by the shorter way: from the negative of `start` where it is closer.
inline void q_slerp(q_type to, const q_type start, const q_type end, double t) {
  double cosine = start[0] * end[0] + start[1] * end[1] + start[2] * end[2] + start[3] * end[3];
  const double sign = cosine < 0 ? -1 : 1;
  cosine *= sign;
  double a = 1 - t;
  double b = t;
  if (1 - cosine > Q_EPSILON) {
    const double angle = acos(cosine);
    a = sin((1 - t) * angle) / sin(angle);
    b = sin(t * angle) / sin(angle);
  }
  for (int i = 0; i < 4; ++i) to[i] = sign * a * start[i] + b * end[i];
}
inline void q_xform(q_vec_type to, const q_type q, const q_vec_type v) {
  const q_type point = {v[0], v[1], v[2], 0};
  q_type inverse, turned;
  q_invert(inverse, q);
  q_mult(turned, q, point);
  q_mult(turned, turned, inverse);
  q_vec_copy(to, turned);
}
inline void q_from_vec(q_type to, const q_vec_type from) {
  q_vec_copy(to, from);
  to[Q_W] = 0;
}
inline void q_to_vec(q_vec_type to, const q_type from) {
  q_vec_copy(to, from);
}
/// The smallest rotation from the direction of a to that of b; none when one has no direction.
inline void q_from_two_vecs(q_type to, const q_vec_type a, const q_vec_type b) {
  q_vec_type u = Q_NULL_VECTOR, v = Q_NULL_VECTOR, axis;
  q_vec_normalize(u, a);
  q_vec_normalize(v, b);
  q_vec_cross_product(axis, u, v);
  const double sine = q_vec_magnitude(axis);
  const double cosine = q_vec_dot_product(u, v);
  if (sine < Q_EPSILON && cosine < 0) {  // half a turn about any normal
    const q_vec_type x = {1, 0, 0}, y = {0, 1, 0};
    q_vec_cross_product(axis, u, fabs(u[0]) < 0.9 ? x : y);
  }
  q_from_axis_angle(to, axis[0], axis[1], axis[2], atan2(sine, cosine));
}

// --- matrices: column matrices act from the left on columns; row matrices are their transposes

inline void q_matrix_copy(q_matrix_type to, const q_matrix_type from) {
  memmove(to, from, sizeof(q_matrix_type));
}
inline void q_matrix_mult(q_matrix_type to, const q_matrix_type a, const q_matrix_type b) {
  q_matrix_type product;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      product[i][j] = 0;
      for (int k = 0; k < 4; ++k) product[i][j] += a[i][k] * b[k][j];
    }
  }
  q_matrix_copy(to, product);
}
inline void q_print_matrix(const q_matrix_type m) {
  for (int i = 0; i < 4; ++i) printf("%10g %10g %10g %10g\n", m[i][0], m[i][1], m[i][2], m[i][3]);
}
inline void q_to_col_matrix(q_matrix_type to, const q_type q) {
  const q_matrix_type unit = Q_ID_MATRIX;
  q_matrix_copy(to, unit);
  for (int j = 0; j < 3; ++j) {
    q_vec_type turned;
    q_xform(turned, q, unit[j]);
    for (int i = 0; i < 3; ++i) to[i][j] = turned[i];
  }
}
inline void q_to_row_matrix(q_matrix_type to, const q_type q) {
  q_type inverse;
  q_invert(inverse, q);
  q_to_col_matrix(to, inverse);
}
inline void q_from_col_matrix(q_type to, const q_matrix_type m) {
  const double trace = m[0][0] + m[1][1] + m[2][2];
  if (trace > 0) {
    const double s = sqrt(trace + 1);
    to[Q_W] = s / 2;
    for (int i = 0; i < 3; ++i) {
      to[i] = (m[(i + 2) % 3][(i + 1) % 3] - m[(i + 1) % 3][(i + 2) % 3]) / (2 * s);
    }
    return;
  }
  int i = m[1][1] > m[0][0] ? 1 : 0;
  if (m[2][2] > m[i][i]) i = 2;
  const int j = (i + 1) % 3;
  const int k = (i + 2) % 3;
  const double s = sqrt(m[i][i] - m[j][j] - m[k][k] + 1);
  to[i] = s / 2;
  to[Q_W] = (m[k][j] - m[j][k]) / (2 * s);
  to[j] = (m[j][i] + m[i][j]) / (2 * s);
  to[k] = (m[k][i] + m[i][k]) / (2 * s);
}
inline void q_from_row_matrix(q_type to, const q_matrix_type m) {
  q_matrix_type columns;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) columns[i][j] = m[j][i];
  }
  q_from_col_matrix(to, columns);
}
/// OpenGL's matrices are row matrices as sixteen numbers.
inline void q_to_ogl_matrix(qogl_matrix_type to, const q_type q) {
  q_matrix_type rows;
  q_to_row_matrix(rows, q);
  memcpy(to, rows, sizeof rows);
}
inline void q_from_ogl_matrix(q_type to, const qogl_matrix_type m) {
  q_matrix_type rows;
  memcpy(rows, m, sizeof rows);
  q_from_row_matrix(to, rows);
}
/// Radians: by roll about x, then by pitch about y, then by yaw about z.
inline void q_from_euler(q_type to, double yaw, double pitch, double roll) {
  q_type x, y, z;
  q_from_axis_angle(x, 1, 0, 0, roll);
  q_from_axis_angle(y, 0, 1, 0, pitch);
  q_from_axis_angle(z, 0, 0, 1, yaw);
  q_mult(to, z, y);
  q_mult(to, to, x);
}
inline void q_col_matrix_to_euler(q_vec_type to, const q_matrix_type m) {
  const double cosine = sqrt(m[0][0] * m[0][0] + m[1][0] * m[1][0]);
  to[Q_PITCH] = atan2(-m[2][0], cosine);
  const bool upright = cosine < Q_EPSILON;  // yaw and roll turn about the same axis
  to[Q_YAW] = upright ? 0 : atan2(m[1][0], m[0][0]);
  to[Q_ROLL] = upright ? atan2(-m[1][2], m[1][1]) : atan2(m[2][1], m[2][2]);
}
inline void q_to_euler(q_vec_type to, const q_type q) {
  q_matrix_type m;
  q_to_col_matrix(m, q);
  q_col_matrix_to_euler(to, m);
}
inline void q_euler_to_col_matrix(q_matrix_type to, double yaw, double pitch, double roll) {
  q_type q;
  q_from_euler(q, yaw, pitch, roll);
  q_to_col_matrix(to, q);
}

// --- a rotation followed by a translation

inline void q_xyz_quat_xform(q_vec_type to, const q_xyz_quat_type* pose, const q_vec_type v) {
  q_xform(to, pose->quat, v);
  q_vec_add(to, to, pose->xyz);
}
inline void q_xyz_quat_invert(q_xyz_quat_type* to, const q_xyz_quat_type* from) {
  q_xyz_quat_type inverse;
  q_invert(inverse.quat, from->quat);
  q_xform(inverse.xyz, inverse.quat, from->xyz);
  q_vec_invert(inverse.xyz, inverse.xyz);
  *to = inverse;
}
/// First `b_from_a`, then `c_from_b`.
inline void q_xyz_quat_compose(q_xyz_quat_type* c_from_a, const q_xyz_quat_type* c_from_b,
                               const q_xyz_quat_type* b_from_a) {
  q_xyz_quat_type pose;
  q_xyz_quat_xform(pose.xyz, c_from_b, b_from_a->xyz);
  q_mult(pose.quat, c_from_b->quat, b_from_a->quat);
  *c_from_a = pose;
}
inline void q_xyz_quat_to_row_matrix(q_matrix_type to, const q_xyz_quat_type* pose) {
  q_to_row_matrix(to, pose->quat);
  q_vec_copy(to[3], pose->xyz);
}
inline void q_row_matrix_to_xyz_quat(q_xyz_quat_type* to, const q_matrix_type m) {
  q_from_row_matrix(to->quat, m);
  q_vec_copy(to->xyz, m[3]);
}
inline void q_xyz_quat_to_ogl_matrix(qogl_matrix_type to, const q_xyz_quat_type* pose) {
  q_matrix_type rows;
  q_xyz_quat_to_row_matrix(rows, pose);
  memcpy(to, rows, sizeof rows);
}
inline void q_ogl_matrix_to_xyz_quat(q_xyz_quat_type* to, const qogl_matrix_type m) {
  q_matrix_type rows;
  memcpy(rows, m, sizeof rows);
  q_row_matrix_to_xyz_quat(to, rows);
}

// --- OpenGL: its products in the order in which it writes them, and row matrices of float

inline void qogl_matrix_copy(qogl_matrix_type to, const qogl_matrix_type from) {
  memmove(to, from, sizeof(qogl_matrix_type));
}
/// Of the points that the product moves, b moves them first.
inline void qogl_matrix_mult(qogl_matrix_type to, const qogl_matrix_type a, const qogl_matrix_type b) {
  q_matrix_type left, right, product;
  memcpy(left, b, sizeof left);  // row matrices act in the reverse order
  memcpy(right, a, sizeof right);
  q_matrix_mult(product, left, right);
  memcpy(to, product, sizeof product);
}
inline void qogl_print_matrix(const qogl_matrix_type m) {
  for (int i = 0; i < 4; ++i) printf("%10g %10g %10g %10g\n", m[i], m[i + 4], m[i + 8], m[i + 12]);
}
inline void qgl_to_matrix(qgl_matrix_type to, const q_type q) {
  q_matrix_type rows;
  q_to_row_matrix(rows, q);
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) to[i][j] = static_cast<float>(rows[i][j]);
  }
}
inline void qgl_from_matrix(q_type to, const qgl_matrix_type m) {
  q_matrix_type rows;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) rows[i][j] = static_cast<double>(m[i][j]);
  }
  q_from_row_matrix(to, rows);
}
inline void qgl_print_matrix(const qgl_matrix_type m) {
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) printf("%10g%c", static_cast<double>(m[i][j]), j < 3 ? ' ' : '\n');
  }
}

// Older names.
#define q_set_vec q_vec_set
#define qogl_matrix_mult_fixed qogl_matrix_mult

#endif
