// The functions and classes that VRPN offers its programs beside devices: threads, bytes, quaternions, times.
#include <gtest/gtest.h>
#include <pthread.h>
#include <quat.h>
#include <unistd.h>
#include <vrpn_Connection.h>
#include <vrpn_Shared.h>
#include <vrpn_Thread.h>

#include <cmath>
#include <limits>
#include <thread>

namespace hapticd {
namespace {

struct Work {
  vrpn_Semaphore go{0}, done{0};
  pthread_t ran = 0;
  int runs = 0;
};

TEST(VrpnThreads, AThreadRunsItsFunctionOnceForEachStart) {
  const auto function = [](vrpn_ThreadData& data) {
    auto* work = static_cast<Work*>(data.pvUD);
    work->go.p();
    work->ran = pthread_self();
    ++work->runs;
    work->done.v();
  };
  EXPECT_TRUE(vrpn_Thread::available());
  EXPECT_GE(vrpn_Thread::number_of_processors(), 1U);
  Work first, second;
  vrpn_Thread thread(function, {&first});
  EXPECT_FALSE(thread.running());
  for (Work* work : {&first, &second}) {
    thread.userData(work);
    EXPECT_EQ(thread.userData(), work);
    ASSERT_TRUE(thread.go());
    EXPECT_TRUE(thread.running());
    EXPECT_FALSE(thread.go()) << "it runs";
    EXPECT_FALSE(thread.kill());
    const vrpn_Thread::thread_t id = thread.pid();
    work->go.v();
    work->done.p();
    EXPECT_TRUE(pthread_equal(id, work->ran) != 0);
    EXPECT_EQ(work->runs, 1);
    while (thread.running()) std::this_thread::yield();
  }
}

TEST(VrpnThreads, AGuardHoldsOneResource) {
  vrpn_Semaphore semaphore(2);
  {
    vrpn::SemaphoreGuard one(semaphore);
    one.lock();  // holds it already
    vrpn::SemaphoreGuard two(semaphore, vrpn::try_to_lock);
    EXPECT_TRUE(two.locked());
    vrpn::SemaphoreGuard three(semaphore, vrpn::try_to_lock);
    EXPECT_FALSE(three.locked());
    one.unlock();
    one.unlock();
    EXPECT_TRUE(three.try_to_lock());
    EXPECT_TRUE(three.try_to_lock());
    EXPECT_EQ(semaphore.condP(), 0);
  }
  EXPECT_EQ(semaphore.condP() + semaphore.condP() + semaphore.condP(), 2);
  EXPECT_TRUE(semaphore.reset(3));
  EXPECT_EQ(semaphore.numResources(), 3);
  EXPECT_EQ(semaphore.p() + semaphore.p() + semaphore.p(), 3);
  EXPECT_EQ(semaphore.condP(), 0);
}

TEST(VrpnShared, BytesPassThroughAPipe) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  EXPECT_EQ(vrpn_noint_block_write(ends[1], "whole", 5), 5);
  close(ends[1]);
  char bytes[8] = {};
  EXPECT_EQ(vrpn_noint_block_read(ends[0], bytes, sizeof bytes), 5);
  EXPECT_STREQ(bytes, "whole");
  close(ends[0]);
  EXPECT_EQ(vrpn_noint_block_write(-1, "x", 1), -1);
}

TEST(VrpnShared, NumbersTurnIntoTheOrderOfMessages) {
  const vrpn_float64 sent = vrpn_htond(1.0);
  EXPECT_EQ(reinterpret_cast<const unsigned char*>(&sent)[0], 0x3f);
  EXPECT_EQ(vrpn_ntohd(sent), 1.0);
  unsigned char bytes[8];
  unsigned char* at = bytes;
  vrpn_int32 left = sizeof bytes;
  EXPECT_EQ(vrpn_buffer(&at, &left, -2.5), 0);
  EXPECT_EQ(left, 0);
  const unsigned char* take = bytes;
  EXPECT_EQ(vrpn_unbuffer<vrpn_float64>(take), -2.5);
  char name[3] = "zz";
  vrpn_strncpynull(name, "abcdef", sizeof name);
  EXPECT_STREQ(name, "ab");
}

// Values of the stock library for the same inputs, to six digits.
TEST(VrpnQuat, RotatesFromTheLeft) {
  q_type z, x, both;
  q_from_axis_angle(z, 0, 0, 2, Q_PI / 2);
  q_from_axis_angle(x, 1, 0, 0, Q_PI / 2);
  q_mult(both, z, x);  // first about x
  q_vec_type v = {0, 1, 0};
  q_xform(v, both, v);
  EXPECT_NEAR(v[2], 1, 1e-12);
  q_vec_type euler;
  q_to_euler(euler, both);
  EXPECT_NEAR(euler[Q_YAW], Q_PI / 2, 1e-12);
  EXPECT_NEAR(euler[Q_ROLL], Q_PI / 2, 1e-12);
  q_matrix_type rows, columns;
  q_to_row_matrix(rows, z);
  q_to_col_matrix(columns, z);
  EXPECT_NEAR(rows[0][1], 1, 1e-12);
  EXPECT_NEAR(columns[1][0], 1, 1e-12);
  for (double angle = 0.1; angle < 6; angle += 0.5) {
    q_type q, back;
    q_from_axis_angle(q, 1, -2, 0.5, angle);
    for (const bool byRows : {false, true}) {
      byRows ? q_to_row_matrix(rows, q) : q_to_col_matrix(rows, q);
      byRows ? q_from_row_matrix(back, rows) : q_from_col_matrix(back, rows);
      const double sign = back[Q_W] * q[Q_W] < 0 ? -1 : 1;
      for (int i = 0; i < 4; ++i) EXPECT_NEAR(sign * back[i], q[i], 1e-9) << angle;
    }
    q_log(back, q);
    q_exp(back, back);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(back[i], q[i], 1e-9) << angle;
  }
}

// Among quaternions of one rotation that of VRPN: in the direction of the end, and of the matrix's largest
// part.
TEST(VrpnQuat, SignsAreThoseOfVrpn) {
  const q_type start = Q_ID_QUAT, end = {0, 0, -sin(0.5), -cos(0.5)};
  q_type half;
  q_slerp(half, start, end, 0.5);
  EXPECT_NEAR(half[Q_Z], -sin(0.25), 1e-12);
  EXPECT_NEAR(half[Q_W], -cos(0.25), 1e-12);
  q_slerp(half, start, end, 1);
  EXPECT_NEAR(half[Q_W], end[Q_W], 1e-12);
  // 200 degrees about (0.6, 0.8, 0), by Rodrigues' formula.
  const double c = cos(Q_DEG_TO_RAD(200)), s = sin(Q_DEG_TO_RAD(200)), x = 0.6, y = 0.8;
  const q_matrix_type columns = {{c + x * x * (1 - c), x * y * (1 - c), y * s, 0},
                                 {x * y * (1 - c), c + y * y * (1 - c), -x * s, 0},
                                 {-y * s, x * s, c, 0},
                                 {0, 0, 0, 1}};
  const double sine = sin(Q_DEG_TO_RAD(100)), cosine = cos(Q_DEG_TO_RAD(100));
  q_matrix_type rows;
  qogl_matrix_type gl;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) gl[4 * j + i] = rows[j][i] = columns[i][j];
  }
  q_type of[3];
  q_from_col_matrix(of[0], columns);
  q_from_row_matrix(of[1], rows);
  q_from_ogl_matrix(of[2], gl);
  for (const q_type& q : of) {
    EXPECT_NEAR(q[Q_X], x * sine, 1e-12);
    EXPECT_NEAR(q[Q_Y], y * sine, 1e-12);
    EXPECT_NEAR(q[Q_Z], 0, 1e-12);
    EXPECT_NEAR(q[Q_W], cosine, 1e-12);
  }
  qogl_matrix_type back;
  q_to_ogl_matrix(back, of[2]);
  for (int i = 0; i < 16; ++i) EXPECT_NEAR(back[i], gl[i], 1e-12) << i;
}

TEST(VrpnQuat, WhatHasNoDirectionIsLeftAlone) {
  q_vec_type zero = Q_NULL_VECTOR;
  ::testing::internal::CaptureStderr();
  q_vec_normalize(zero, zero);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(zero[i], 0);
  const q_vec_type up = {0, 1, 0};
  q_type turn;
  q_from_two_vecs(turn, zero, up);
  EXPECT_NE(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(turn[Q_W], 1);
  EXPECT_EQ(q_vec_magnitude(turn), 0);
  double x, y, z, angle;
  const q_type whole = {0, 0, 0, -1};  // a turn by 2 pi is none
  q_to_axis_angle(&x, &y, &z, &angle, whole);
  EXPECT_EQ(angle, 0);
  EXPECT_EQ(z, 1);
  const q_type q = {0.6 * sin(1.25), 0, -0.8 * sin(1.25), cos(1.25)};
  q_to_axis_angle(&x, &y, &z, &angle, q);
  EXPECT_NEAR(angle, 2.5, 1e-12);
  EXPECT_NEAR(x, 0.6, 1e-12);
  EXPECT_EQ(y, 0);
  EXPECT_NEAR(z, -0.8, 1e-12);
}

TEST(VrpnQuat, VectorsAndMatrices) {
  q_vec_type a = {1, 2, 3}, b = {-1, 5, 7}, v;
  EXPECT_DOUBLE_EQ(q_vec_distance(a, b), sqrt(29.0));
  q_vec_subtract(a, a, b);
  q_type q = {2, -4, 4, 8};
  q_normalize(q, q);
  const q_type unit = {0.2, -0.4, 0.4, 0.8};
  for (int i = 0; i < 4; ++i) EXPECT_DOUBLE_EQ(q[i], unit[i]);
  q_from_vec(q, a);
  EXPECT_EQ(q[Q_W], 0);
  q_to_vec(v, q);
  EXPECT_EQ(v[0], 2);
  EXPECT_EQ(v[1], -3);
  EXPECT_EQ(v[2], -4);
  q_matrix_type m = {{1, 2, 0, 0}, {0, 1, 3, 0}, {0, 0, 1, 4}, {5, 0, 0, 1}};
  q_matrix_mult(m, m, m);
  const q_matrix_type square = {{1, 4, 6, 0}, {0, 1, 6, 12}, {20, 0, 1, 8}, {10, 10, 0, 1}};
  for (int i = 0; i < 16; ++i) EXPECT_EQ(m[i / 4][i % 4], square[i / 4][i % 4]) << i;
  q_euler_to_col_matrix(m, Q_PI / 2, 0, Q_PI / 2);  // x to y, y to z, z to x
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(m[i][j], i == (j + 1) % 3, 1e-12) << i << j;
  }
  ::testing::internal::CaptureStdout();
  q_vec_print(v);
  q_print(unit);
  q_print_matrix(square);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(),
            "(2, -3, -4)\n[(0.2, -0.4, 0.4), 0.8]\n"
            "         1          4          6          0\n"
            "         0          1          6         12\n"
            "        20          0          1          8\n"
            "        10         10          0          1\n");
}

// The product of OpenGL's matrices of two poses is the matrix of the poses composed.
TEST(VrpnQuat, MatricesOfOpenGl) {
  q_xyz_quat_type a = {{1, 2, 3}, Q_ID_QUAT};
  q_xyz_quat_type b = {{-4, 5, 0.5}, Q_ID_QUAT};
  q_from_axis_angle(a.quat, 0, 1, 0, 0.7);
  q_from_axis_angle(b.quat, 1, 2, -1, -1.1);
  q_xyz_quat_type both;
  q_xyz_quat_compose(&both, &a, &b);
  qogl_matrix_type expected, product, second;
  q_xyz_quat_to_ogl_matrix(expected, &both);
  q_xyz_quat_to_ogl_matrix(product, &a);
  q_xyz_quat_to_ogl_matrix(second, &b);
  qogl_matrix_mult(product, product, second);
  for (int i = 0; i < 16; ++i) EXPECT_NEAR(product[i], expected[i], 1e-12) << i;
  qogl_matrix_copy(second, product);
  EXPECT_EQ(second[13], product[13]);

  qgl_matrix_type rows;
  qgl_to_matrix(rows, a.quat);
  const q_vec_type x = {1, 0, 0};
  q_vec_type turned;
  q_xform(turned, a.quat, x);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(static_cast<double>(rows[0][i]), turned[i], 1e-6) << "as rows";
  q_type back;
  qgl_from_matrix(back, rows);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(back[i], a.quat[i], 1e-6);
}

TEST(VrpnQuat, PosesComposeAndInvert) {
  q_xyz_quat_type a = {{1, 2, 3}, Q_ID_QUAT};
  q_from_axis_angle(a.quat, 0, 1, 0, 0.7);
  q_xyz_quat_type inverse, unit;
  q_xyz_quat_invert(&inverse, &a);
  q_xyz_quat_compose(&unit, &a, &inverse);
  EXPECT_NEAR(q_vec_magnitude(unit.xyz), 0, 1e-12);
  EXPECT_NEAR(unit.quat[Q_W], 1, 1e-12);
  qogl_matrix_type matrix;
  q_xyz_quat_to_ogl_matrix(matrix, &a);
  EXPECT_EQ(matrix[13], 2);
  q_xyz_quat_type back;
  q_ogl_matrix_to_xyz_quat(&back, matrix);
  EXPECT_NEAR(back.quat[Q_Y], a.quat[Q_Y], 1e-12);
  q_type half, whole, none = Q_ID_QUAT;
  q_from_axis_angle(whole, 0, 0, 1, 1);
  q_slerp(half, none, whole, 0.5);
  EXPECT_NEAR(half[Q_Z], sin(0.25), 1e-12);
  const q_vec_type right = {2, 0, 0}, left = {-1, 0, 0};
  q_from_two_vecs(half, right, left);
  EXPECT_NEAR(half[Q_W], 0, 1e-12);
  EXPECT_NEAR(half[Q_X], 0, 1e-12);
}

TEST(VrpnShared, TimevalArithmetic) {
  const timeval a{2, 900000};
  const timeval b{1, 200000};
  EXPECT_TRUE(vrpn_TimevalEqual(vrpn_TimevalSum(a, b), {4, 100000}));
  EXPECT_TRUE(vrpn_TimevalEqual(vrpn_TimevalDiff(a, b), {1, 700000}));
  EXPECT_TRUE(vrpn_TimevalGreater(a, b));
  EXPECT_EQ(vrpn_TimevalDuration(a, b), 1700000UL);
  EXPECT_EQ(vrpn_TimevalMsecs(a), 2900);
  EXPECT_TRUE(vrpn_TimevalEqual(vrpn_MsecsTimeval(2900), a));
  EXPECT_TRUE(vrpn_TimevalEqual(vrpn_TimevalScale(b, 2), {2, 400000}));
}

TEST(VrpnShared, TimesAreNormalized) {
  const auto is = [](const timeval& t, time_t seconds, suseconds_t us) {
    const timeval n = vrpn_TimevalNormalize(t);
    return n.tv_sec == seconds && n.tv_usec == us;
  };
  EXPECT_TRUE(is({2, 3500000}, 5, 500000));
  EXPECT_TRUE(is({1, -300000}, 0, 700000));
  EXPECT_TRUE(is({-1, 300000}, 0, -700000));
  EXPECT_TRUE(is({-2, -1100000}, -3, -100000));
  EXPECT_TRUE(vrpn_test_pack_unpack());
}

TEST(VrpnShared, TimesThatDoNotFitAreVeryLong) {
  const timeval most{std::numeric_limits<time_t>::max(), 0};
  const timeval least{std::numeric_limits<time_t>::min(), 0};
  const timeval second{1, 0};
  EXPECT_TRUE(vrpn_TimevalGreater(vrpn_TimevalSum(most, most), second));
  EXPECT_TRUE(vrpn_TimevalGreater(second, vrpn_TimevalSum(least, least)));
  EXPECT_TRUE(vrpn_TimevalGreater(vrpn_TimevalDiff(most, least), second));
  EXPECT_TRUE(vrpn_TimevalGreater(vrpn_TimevalScale(second, 1e30), second));
  EXPECT_TRUE(vrpn_TimevalGreater(vrpn_MsecsTimeval(1e30), second));
  EXPECT_TRUE(vrpn_TimevalGreater(second, vrpn_MsecsTimeval(-1e30)));
  EXPECT_TRUE(vrpn_TimevalEqual(vrpn_MsecsTimeval(std::nan("")), {}));
}

TEST(VrpnShared, BuffersAreBigEndianAndBounded) {
  char buffer[12];
  char* insert = buffer;
  vrpn_int32 left = sizeof buffer;
  EXPECT_EQ(vrpn_buffer(&insert, &left, vrpn_int32{0x01020304}), 0);
  EXPECT_EQ(vrpn_buffer(&insert, &left, 1.0), 0);
  EXPECT_EQ(vrpn_buffer(&insert, &left, vrpn_int32{0}), -1) << "full";
  EXPECT_EQ(buffer[0], 1);
  EXPECT_EQ(buffer[4], 0x3f);
  const char* take = buffer;
  vrpn_int32 number = 0;
  vrpn_float64 real = 0;
  vrpn_unbuffer(&take, &number);
  vrpn_unbuffer(&take, &real);
  EXPECT_EQ(number, 0x01020304);
  EXPECT_EQ(real, 1.0);
}

TEST(VrpnShared, CopiedTextEndsWithinItsBuffer) {
  char room[4] = {'x', 'x', 'x', 'x'};
  vrpn_strcpy(room, "Phantom");
  EXPECT_STREQ(room, "Pha");
  vrpn_strcpy(room, "P");
  EXPECT_STREQ(room, "P");
}

}  // namespace
}  // namespace hapticd
