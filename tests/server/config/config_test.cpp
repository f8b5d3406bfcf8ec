#include "server/config/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "device/drivers/drivers.h"

namespace hapticd::server {
namespace {

using testing::HasSubstr;

std::string errorOf(const std::string& text) {
  try {
    parseConfig(text, "test.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Config, DefaultsAreOneSimulatedPhantomOnLoopback) {
  const ServerConfig config = parseConfig("", "test.toml");
  EXPECT_EQ(config.listenAddress, "127.0.0.1");
  EXPECT_EQ(config.port, 3883);
  ASSERT_EQ(config.devices.size(), 1U);
  EXPECT_EQ(config.devices[0].names, std::vector<std::string>{"Phantom"});
  EXPECT_EQ(config.devices[0].driver, "simulated");
  EXPECT_EQ(config.devices[0].reportRate_Hz, 1000);
  EXPECT_EQ(config.devices[0].linearTolerance_m, 0.001);
}

TEST(Config, ReadsEverySwitch) {
  const ServerConfig config = parseConfig(R"(
listen = "0.0.0.0:4000"
insecure = true
callback_hosts = ["10.0.0.7"]
record = "session-%H%M.haptics"
http = "0.0.0.0:80"
http_allow = ["lab7", "lab7.example.org:9000"]
[compat]
haply = "127.0.0.1:10002"
haply_hold_ms = 50
haply_origins = ["http://localhost:5173"]
[[device]]
names = ["Left", "Tracker0"]
report_rate_Hz = 250
linear_tolerance_mm = 0.5
angular_tolerance_rad = 0.1
tool_radius_mm = 2
workspace = "paper"
force_shading = true
stribeck_speed_mm_per_s = 3
held_force_power_mW = 30
vibration_contact_pulls = true
scene = "shared"
control = "list"
control_list = ["10.0.0.5", "10.0.0.6"]
black_box_dir = "/var/lib/hapticd"
black_box_keep = 3
material_scale = "device"
quaternion_order = "wxyz"
force_report = "normal"
workspace_fit = "enclose"
vibration_contact_unit = "Hz"
vibration_motor_frame = "device"
mirrors = true
compat_mirrors = true
scene_on_disconnect = "clear"
[[device]]
name = "Right"
workspace = [-1, -2, -3, 4, 5, 6]
)",
                                          "test.toml");
  EXPECT_EQ(config.listenAddress, "0.0.0.0");
  EXPECT_EQ(config.port, 4000);
  EXPECT_EQ(config.callbackHosts, std::vector<std::string>{"10.0.0.7"});
  EXPECT_EQ(config.record, "session-%H%M.haptics");
  EXPECT_EQ(config.http, "0.0.0.0:80");
  EXPECT_EQ(config.httpAllow, (std::vector<std::string>{"lab7", "lab7.example.org:9000"}));
  EXPECT_EQ(config.compat.haply, "127.0.0.1:10002");
  EXPECT_DOUBLE_EQ(config.compat.haplyHold_s, 0.05);
  EXPECT_EQ(config.compat.haplyOrigins, std::vector<std::string>{"http://localhost:5173"});
  ASSERT_EQ(config.devices.size(), 2U);
  const DeviceConfig& left = config.devices[0];
  EXPECT_EQ(left.names, (std::vector<std::string>{"Left", "Tracker0"}));
  EXPECT_EQ(left.reportRate_Hz, 250);
  EXPECT_DOUBLE_EQ(left.linearTolerance_m, 0.0005);
  EXPECT_DOUBLE_EQ(left.toolRadius_m, 0.002);
  EXPECT_EQ(left.workspace_mm, (std::vector<double>{-80, -80, -70, 80, 80, 20}));
  EXPECT_TRUE(left.forceShading);
  EXPECT_DOUBLE_EQ(left.stribeckSpeed_m_per_s, 0.003);
  EXPECT_DOUBLE_EQ(left.heldForcePower_W, 0.030);
  EXPECT_TRUE(left.vibrationContactPulls);
  EXPECT_EQ(left.scene, "shared");
  EXPECT_EQ(left.control, Control::list);
  EXPECT_EQ(left.controlList, (std::vector<std::string>{"10.0.0.5", "10.0.0.6"}));
  EXPECT_EQ(left.blackBoxDir, "/var/lib/hapticd");
  EXPECT_EQ(left.blackBoxKeep, 3);
  EXPECT_EQ(left.materialScale, MaterialScale::device);
  EXPECT_EQ(left.quaternionOrder, QuaternionOrder::wxyz);
  EXPECT_EQ(left.forceReport, ForceReport::normal);
  EXPECT_EQ(left.workspaceFit, WorkspaceFit::enclose);
  EXPECT_EQ(left.vibrationContactUnit, VibrationUnit::hertz);
  EXPECT_EQ(left.vibrationMotorFrame, VibrationFrame::device);
  EXPECT_EQ(left.sceneOnDisconnect, SceneOnDisconnect::clear);
  EXPECT_EQ(config.devices[1].names, std::vector<std::string>{"Right"});
  EXPECT_EQ(config.devices[1].workspace_mm.front(), -1);
}

TEST(Config, ErrorsNameLineKeyValueAndRemedy) {
  EXPECT_EQ(errorOf("listn = \"x\""), "test.toml:1: unknown key 'listn'; did you mean 'listen'?");
  EXPECT_EQ(errorOf("frobnicate = 1"),
            "test.toml:1: unknown key 'frobnicate'; docs/configuration.md lists the keys");
  EXPECT_EQ(errorOf("report_rate_Hz = 500"), "test.toml:1: 'report_rate_Hz' belongs in a [[device]]");
  EXPECT_EQ(errorOf("[[device]]\nlisten = \"127.0.0.1\""),
            "test.toml:2: 'listen' belongs above the first [[device]]");
  EXPECT_EQ(errorOf("\n[[device]]\nreport_rate_Hz = \"fast\""),
            "test.toml:3: 'report_rate_Hz' is 'fast', expected a number");
  EXPECT_EQ(errorOf("[[device]]\nmaterial_scale = \"big\""),
            "test.toml:2: 'material_scale' is 'big', expected \"reference\" or \"device\"");
  EXPECT_EQ(errorOf("[[device]]\nreport_rate_Hz = 2000"),
            "test.toml:2: device 'Phantom': report_rate_Hz must be between 0.1 and 1000, got 2000");
  EXPECT_EQ(errorOf("[[device]]\nname=\"A\"\n[[device]]\nname=\"A\""),
            "test.toml:4: the name 'A' is used twice; device names must be unique");
  EXPECT_EQ(errorOf("[[device]]\nname=\"A@B\""),
            "test.toml:2: device name \"A@B\" must have 1 to 95 bytes, no '@' and no control characters");
  EXPECT_THAT(errorOf("[[device]]\nworkspace=[]"),
              HasSubstr("test.toml:2: 'workspace' is [], expected \"device\", \"paper\" or six numbers"));
  EXPECT_EQ(errorOf("[[device]]\nworkspace=[1,2,3]"),
            "test.toml:2: device 'Phantom': workspace needs six numbers in mm: min x y z, then max x y z, "
            "each min below its max");
  EXPECT_NE(errorOf("listen = ").find("test.toml:1: "), std::string::npos);
  EXPECT_NE(errorOf("listen = \"1.2.3.4:70000\"").find("70000"), std::string::npos);
  EXPECT_EQ(errorOf("listen = \"\""), "test.toml:1: listen: is empty; it is ADDR:PORT, e.g. 127.0.0.1:3883");
}

TEST(Config, InvalidValuesAreNamed) {
  EXPECT_NE(errorOf("seconds = -5").find("got -5"), std::string::npos);
  EXPECT_NE(errorOf("seconds = nan").find("got nan"), std::string::npos);
  EXPECT_NE(errorOf("seconds = 1e300").find("1e+300"), std::string::npos);
  EXPECT_NE(errorOf("callback_hosts = [\"foo bar\"]").find("\"foo bar\""), std::string::npos);
  EXPECT_NE(errorOf("http = \"lab7:80\"").find("\"lab7:80\" is not ADDR:PORT"), std::string::npos);
  EXPECT_NE(errorOf("http = \"127.0.0.1:99999\"").find("127.0.0.1:99999"), std::string::npos);
  EXPECT_NE(errorOf("http_allow = [\"http://lab7/\"]").find("\"http://lab7/\""), std::string::npos);
  EXPECT_NE(errorOf("http_allow = [\"lab7:\"]").find("\"lab7:\""), std::string::npos);
  EXPECT_NE(errorOf("http_allow = [\"lab7:99999\"]").find("\"lab7:99999\""), std::string::npos);
  EXPECT_NE(errorOf("[[device]]\nname=\"a\\nb\"").find("\"a\\x0ab\""), std::string::npos);
  // The system would take the name of the file to end there.
  for (const char* key : {"record", "socket", "tokens", "tls"}) {
    EXPECT_EQ(errorOf(std::string(key) + " = \"/tmp/a\\u0000b\""),
              std::string("test.toml:1: '") + key +
                  "' is \"/tmp/a\\u0000b\", expected a quoted string without NUL characters");
  }
  EXPECT_EQ(errorOf("[[device]]\nblack_box_dir = \"a\\u0000b\""),
            "test.toml:2: 'black_box_dir' is \"a\\u0000b\", expected a quoted string without NUL characters");
  EXPECT_NE(errorOf("[[device]]\nname=\"VRPN Control\"").find("'VRPN Control'"), std::string::npos);
  EXPECT_NE(errorOf("[[device]]\nworkspace=[-1e300,0,0,1,1,1]").find("-1e+300"), std::string::npos);
}

TEST(Config, ValuesOutOfRangeAreNamedWithTheirLine) {
  EXPECT_EQ(errorOf("\nseconds = -5"), "test.toml:2: seconds must be between 0 and 1000000000, got -5");
  EXPECT_EQ(errorOf("[[device]]\nlinear_tolerance_mm = 1000.0001"),
            "test.toml:2: device 'Phantom': linear_tolerance_mm must be between 0 and 1000, got 1000.0001");
  EXPECT_EQ(errorOf("listen = \"localhost:1\""),
            "test.toml:1: listen: \"localhost\" is not an IPv4 address such as 127.0.0.1");
  EXPECT_EQ(errorOf("[[device]]\nname=\"A\"\n[[device]]\nname=\"B\"\n\ndriver=\"hal\""),
            "test.toml:6: device 'B': unknown driver 'hal'; available: simulated, openhaptics, "
            "forcedimension, haply, evdev, replay");
  EXPECT_EQ(errorOf("[[device]]\nservo_rate_Hz=500\nreport_rate_Hz=1000"),
            "test.toml:3: device 'Phantom': report_rate_Hz must be between 0.1 and 500, got 1000");
  EXPECT_EQ(errorOf("[[device]]\nhand=\"\""),
            "test.toml:2: device 'Phantom': hand is empty; use \"script\", or the name of a file");
  EXPECT_EQ(errorOf("record=\"x.mcap\""),
            "test.toml:1: record: the server writes *.haptics recordings only, got 'x.mcap'; convert the "
            "recording afterwards with 'hapticd export FILE.haptics --to mcap'");
  EXPECT_EQ(errorOf("[[device]]\nblack_box_keep=-1"),
            "test.toml:2: device 'Phantom': black_box_keep must be between 0 and 1000, got -1");
  EXPECT_EQ(errorOf("[[device]]\nblack_box_keep=2.5"),
            "test.toml:2: 'black_box_keep' is 2.5, expected a whole number");
  EXPECT_NE(errorOf("[[device]]\nblack_box_keep=99999999999").find("99999999999"), std::string::npos);
  EXPECT_EQ(errorOf("[[device]]\nname=\"A\"\nnames=[\"B\"]"),
            "test.toml:2: 'name' is 'A', expected either 'name' or 'names', not both");
}

TEST(Config, ReportsFollowASlowServoUnlessTheirRateIsSet) {
  EXPECT_EQ(parseConfig("[[device]]\nservo_rate_Hz = 500\n", "test").devices.front().reportRate_Hz, 500);
  EXPECT_EQ(parseConfig("[[device]]\nservo_rate_Hz = 4000\n", "test").devices.front().reportRate_Hz, 1000);
}

TEST(Config, ErrorsOfControlNameTheRemedy) {
  EXPECT_EQ(errorOf("[[device]]\ncontrol=\"list\""),
            "test.toml:2: device 'Phantom': control = \"list\" needs the addresses that may command, e.g. "
            "control_list = "
            "[\"10.0.0.5\"]");
  EXPECT_EQ(errorOf("[[device]]\ncontrol=\"first\"\ncontrol_list=[\"10.0.0.5\"]"),
            "test.toml:3: device 'Phantom': control_list has no effect without control = \"list\"");
  EXPECT_EQ(
      errorOf("[[device]]\ncontrol=\"list\"\ncontrol_list=[\"10.0.0.5:80\"]"),
      "test.toml:3: device 'Phantom': control_list: \"10.0.0.5:80\" is not an IPv4 address such as 10.0.0.5");
  EXPECT_EQ(errorOf("[[device]]\ncontrol=\"nobody\""),
            "test.toml:2: 'control' is 'nobody', expected \"any\" or \"first\" or \"list\"");
}

TEST(Config, NamesHaveNoControlCharactersAndAreCountedInBytes) {
  const auto named = [](const std::string& name) { return errorOf("[[device]]\nname=\"" + name + "\""); };
  const std::string refusal = " must have 1 to 95 bytes, no '@' and no control characters";
  EXPECT_THAT(named("a\\tb"), HasSubstr(refusal));
  EXPECT_THAT(named("a\\u007fb"), HasSubstr(refusal));
  EXPECT_THAT(named("a\\u0085b"), HasSubstr(refusal)) << "a new line to many programs that read the log";
  EXPECT_THAT(named("a\\u009b2Jb"), HasSubstr(refusal)) << "a command to terminals";
  EXPECT_EQ(named("a\\u00a0b"), "");
  EXPECT_THAT(named(std::string(96, 'a')), HasSubstr(refusal));
  EXPECT_EQ(named(std::string(95, 'a')), "");
  std::string letters;
  for (int i = 0; i < 48; ++i) letters += "ä";
  EXPECT_THAT(named(letters), HasSubstr(refusal)) << "48 letters of 2 bytes";
  EXPECT_EQ(named(letters.substr(2)), "");
  ServerConfig config;
  config.devices.front().names = {"B\xf6hm"};
  EXPECT_NO_THROW(validate(config)) << "names of VRPN need not be UTF-8";
}

TEST(Config, NamesBeyondTheNumbersOfVrpnAreRefused) {
  ServerConfig config;
  std::vector<std::string>& names = config.devices.front().names;
  names.clear();
  for (int i = 0; i < 1999; ++i) names.push_back("N" + std::to_string(i));
  EXPECT_NO_THROW(validate(config));
  names.emplace_back("N1999");
  EXPECT_THROW(validate(config), InvalidValue);
  names.resize(500);
  config.devices.front().mirrors = true;
  EXPECT_THROW(validate(config), InvalidValue) << "four names each";
  names.resize(499);
  EXPECT_NO_THROW(validate(config));
}

TEST(Config, AnErrorIsOneLineWhateverTheValueIs) {
  for (const char* text : {"\"a\\nb\" = 1", "[[device]]\ndriver = \"a\\nb\"",
                           "[[device]]\nname = \"A\"\nscene = \"a\\nb\"\ncontrol = \"first\"\n"
                           "[[device]]\nname = \"B\"\nscene = \"a\\nb\""}) {
    EXPECT_THAT(errorOf(text), HasSubstr("a\xef\xbf\xbd"
                                         "b"));
  }
}

TEST(Config, DevicesOfOneSceneMustAgreeOnSceneOnDisconnect) {
  const std::string text = errorOf(
      "[[device]]\nname=\"A\"\nscene=\"table\"\n[[device]]\nname=\"B\"\nscene=\"table\"\nscene_on_disconnect="
      "\"clear\"");
  EXPECT_EQ(
      text,
      "test.toml:7: device 'B': all devices of the scene 'table' must have the same scene_on_disconnect");
}

TEST(Config, ListeningForOtherMachinesNeedsTlsTrustOrAPlainWord) {
  const std::string open = "listen = \"0.0.0.0\"\n";
  EXPECT_THAT(errorOf(open), testing::HasSubstr("insecure = true"));
  EXPECT_THAT(errorOf("http = \"0.0.0.0:8080\"\n"), testing::HasSubstr("everybody on these networks"));
  for (const std::string good :
       {"insecure = true\n", "tls = \"generated\"\n", "tls = \"/c.pem\"\ntls_key = \"/k.pem\"\n",
        "trusted_networks = [\"10.0.0.0/8\"]\n"}) {
    EXPECT_NO_THROW(parseConfig(good + open, "test.toml")) << good;
  }
  EXPECT_NO_THROW(parseConfig("listen = \"127.0.0.2\"\n", "test.toml"));
}

TEST(Config, RefusesMalformedAccess) {
  const std::pair<const char*, const char*> bad[]{
      {"trusted_networks = [\"10.0.0.1/24\"]\n",
       "the bits of \"10.0.0.1/24\" after the first 24 must be 0: use 10.0.0.0/24"},
      {"trusted_networks = [\"10.0.0.0/33\"]\n", "is not a network"},
      {"trusted_networks = [\"lab\"]\n", "is not a network"},
      {"owner_users = [\"no such user\"]\n", "there is no user"},
      {"socket = \"relative.sock\"\n", "is not an absolute path"},
      {"socket = \"/run/hapticd/\"\n", "is not an absolute path"},
      {"http = \"\"\n", "test.toml:1: http: \"\" is not ADDR:PORT"},
      {"tls = \"on\"\n", "is not off, generated, or the absolute path"},
      {"tls = \"/c.pem\"\n", "needs its key"},
      {"tls_key = \"/k.pem\"\n", "has no effect without a certificate"},
      {"tls_loopback = true\n", "needs a certificate"},
  };
  for (const auto& [text, error] : bad) EXPECT_THAT(errorOf(text), testing::HasSubstr(error)) << text;
  const auto socket = [](std::size_t bytes) { return "socket = \"/" + std::string(bytes - 1, 's') + "\"\n"; };
  EXPECT_EQ(errorOf(socket(107)), "");
  EXPECT_EQ(errorOf(socket(108)),
            "test.toml:1: socket: the path has 108 bytes, and that of a Unix socket at most 107");
}

// Every key differs from its default, so that a key that is not written or not read is noticed.
ServerConfig unusual() {
  ServerConfig config;
  config.listenAddress = "0.0.0.0";
  config.port = 4000;
  config.allowNoRealtime = true;
  config.seconds = 0.1;
  config.callbackHosts = {"10.0.0.7", "10.0.0.8"};
  config.record = "session.haptics";
  config.http = "10.0.0.1:9000";
  config.httpAllow = {"lab7"};
  config.announce = false;
  config.socket = "/run/lab.sock";
  config.tokens = "/etc/tokens";
  config.ownerUsers = {"0"};
  config.operatorUsers = {"5000"};
  config.trustedNetworks = {"10.0.0.0/24"};
  config.tls = "/etc/cert.pem";
  config.tlsKey = "/etc/key.pem";
  config.tlsLoopback = true;
  config.insecure = true;
  config.compat = {"10.0.0.1:10002", 0.02, {"https://lab7"}};
  config.limits = {.connections = 12,
                   .connectionsPerAddress = 7,
                   .unfinishedConnections = 17,
                   .memory_MB = 100,
                   .clientMemory_MB = 40,
                   .sendQueue_MB = 4,
                   .batches_MB = 50,
                   .objects = 20,
                   .vertices = 1000,
                   .triangles = 2000,
                   .effects = 8,
                   .commandsPerSecond = 5000,
                   .recording_MB = 9,
                   .blackBoxes_MB = 3,
                   .log_kB_per_s = 11};
  DeviceConfig device;
  device.names = {"Left \"hand\" \\", "Tracker0"};
  device.driver = "evdev";
  device.hardware = "/dev/input/event5\t\n\x7f";
  device.driverKeys = {{"wheel_profile", "wheel.toml"}};
  device.calibrate = true;
  device.enableForces = true;
  device.isolate = true;
  device.isolateWatch = true;
  device.servoRate_Hz = 4000;
  device.reportRate_Hz = 1.0 / 3;
  device.linearTolerance_m = 0.3e-3;
  device.angularTolerance_rad = 0.1;
  device.toolRadius_m = 1e-3 / 3;
  device.workspace_mm = {-1.5, -2, -3, 4, 5, 6};
  device.materialScale = MaterialScale::device;
  device.quaternionOrder = QuaternionOrder::wxyz;
  device.forceReport = ForceReport::normal;
  device.workspaceFit = WorkspaceFit::enclose;
  device.vibrationContactUnit = VibrationUnit::hertz;
  device.vibrationMotorFrame = VibrationFrame::device;
  device.forceShading = true;
  device.stribeckSpeed_m_per_s = 0.004;
  device.heldForcePower_W = 0.005;
  device.vibrationContactPulls = true;
  device.mirrors = true;
  device.compatMirrors = true;
  device.scene = "shared";
  device.sceneOnDisconnect = SceneOnDisconnect::clear;
  device.control = Control::list;
  device.controlList = {"10.0.0.5"};
  device.blackBoxDir = "/tmp/boxes";
  device.blackBoxKeep = 3;
  config.devices = {device, DeviceConfig{}};
  config.devices[1].names = {"Right"};
  config.devices[1].hand = "hand.csv";
  config.devices[1].workspace_mm.assign(kPaperWorkspace_mm.begin(), kPaperWorkspace_mm.end());
  config.devices[1].control = Control::first;
  return config;
}

TEST(Config, TheHaplyPortIsNoOtherPort) {
  const std::string port = "[compat]\nhaply = \"127.0.0.1:10001\"\n";
  EXPECT_EQ(errorOf(port), "");
  EXPECT_EQ(errorOf(port + "[[device]]\ndriver = \"haply\"\n"),
            "test.toml:2: haply: \"127.0.0.1:10001\" is the port of the service that the device 'Phantom' is "
            "reached through; use another port");
  EXPECT_NE(errorOf(port + "[[device]]\ndriver = \"haply\"\nhardware = \"127.0.0.1:10001/04BA\"\n"), "");
  EXPECT_EQ(errorOf(port + "[[device]]\ndriver = \"haply\"\nhardware = \"127.0.0.1:9999/04BA\"\n"), "");
  EXPECT_EQ(errorOf(port + "[[device]]\ndriver = \"haply\"\nhardware = \"10.0.0.7:10001\"\n"), "");
  EXPECT_NE(errorOf("[compat]\nhaply = \"0.0.0.0\"\n[[device]]\ndriver = \"haply\"\n"), "");
  EXPECT_NE(errorOf("[compat]\nhaply = \":3883\"\n").find("the port of listen"), std::string::npos);
  EXPECT_NE(errorOf("[compat]\nhaply = \":8080\"\n").find("the port of http"), std::string::npos);
}

TEST(Config, ErrorsInCompatNameTheirLine) {
  EXPECT_EQ(errorOf("[compat]\n\nhaply = \"here\""),
            "test.toml:3: haply: \"here\" is not ADDR:PORT such as 127.0.0.1:10001");
  EXPECT_EQ(errorOf("[compat]\nhaply_hold_ms = 500"),
            "test.toml:2: haply_hold_ms must be between 10 and 100, got 500");
  EXPECT_EQ(errorOf("[compat]\nhaply_origins = [\"localhost\"]"),
            "test.toml:2: haply_origins: \"localhost\" is not an origin such as http://localhost:5173");
  EXPECT_EQ(errorOf("[compat]\nhapli = \"\""), "test.toml:2: unknown key 'hapli'; did you mean 'haply'?");
  EXPECT_EQ(errorOf("compat = 3"), "test.toml:1: 'compat' must be a table: [compat]");
  EXPECT_EQ(errorOf("haply = \"127.0.0.1:10001\""), "test.toml:1: 'haply' belongs in [compat]");
  EXPECT_EQ(errorOf("[limits]\nhaply_hold_ms = 50"), "test.toml:2: 'haply_hold_ms' belongs in [compat]");
  EXPECT_EQ(errorOf("[[device]]\nhaply_hold_ms = 50"),
            "test.toml:2: 'haply_hold_ms' belongs in [compat], which belongs above the first [[device]]");
}

TEST(Config, KeysOfOtherDriversAreRefused) {
  EXPECT_EQ(errorOf("[[device]]\ndriver = \"evdev\"\nwheel_profile = \"wheel.toml\"\n"), "");
  EXPECT_EQ(errorOf("[[device]]\nwheel_profile = \"wheel.toml\"\n"),
            "test.toml:2: device 'Phantom': the driver 'simulated' has no key wheel_profile; remove it");
  EXPECT_EQ(errorOf("[[device]]\nwheel_profile = \"\"\n"), "") << "as toToml() writes it";
  EXPECT_EQ(errorOf("[[device]]\ndriver = \"evdev\"\nhand = \"h.csv\"\n"),
            "test.toml:3: device 'Phantom': the driver 'evdev' is led by its own hand; remove \"h.csv\"");
  EXPECT_EQ(errorOf("[[device]]\nhardware = \"left\"\n"),
            "test.toml:2: device 'Phantom': the driver 'simulated' has no hardware to choose from; remove "
            "\"left\"");
}

TEST(Config, NamesOfMirrorsMustBeFree) {
  const std::string text = "[[device]]\nnames = [\"A\", \"A.touch\"]\n";
  EXPECT_EQ(errorOf(text), "");
  EXPECT_NE(errorOf(text + "mirrors = true\n").find("'A.touch' is used twice"), std::string::npos);
}

TEST(Config, ADriverWithoutAVendorLibraryCannotBeIsolated) {
  EXPECT_EQ(
      errorOf("[[device]]\nisolate = true\n"),
      "test.toml:2: device 'Phantom': the driver 'simulated' loads no vendor library and cannot be isolated; "
      "remove isolate");
  EXPECT_EQ(
      errorOf("[[device]]\nisolate_watch = true\n"),
      "test.toml:2: device 'Phantom': the driver 'simulated' cannot be isolated, so there is nothing to "
      "watch; remove isolate_watch");
  EXPECT_THAT(errorOf("[[device]]\ndriver = \"openhaptics\"\nisolate = false\nisolate_watch = true\n"),
              HasSubstr("isolate is false, so there is nothing to watch"));
}

TEST(Config, ARecordingBringsNoPortOfTheServerThatWroteIt) {
  ServerConfig there;
  there.listenAddress = "127.0.0.2";
  there.compat.haply = "127.0.0.1:10001";
  there.devices.front().hardware = "left";  // old versions let the simulated hand have one
  there.limits.objects = 5;
  ServerConfig here;
  here.limits = there.limits;
  EXPECT_EQ(parseRecordedConfig(toToml(there), "test"), here);
}

TEST(Config, IsolationIsTheDriversChoiceUnlessConfigured) {
  EXPECT_EQ(parseConfig("", "test").devices.front().isolate, std::nullopt);
  EXPECT_EQ(
      parseConfig("[[device]]\ndriver = \"openhaptics\"\nisolate = false\n", "test").devices.front().isolate,
      false);
  EXPECT_TRUE(device::findDriver("openhaptics")->isolatedByDefault) << "HDAPI has no watchdog";
}

TEST(Config, WhatCannotWorkIsRefused) {
  EXPECT_THAT(errorOf("listen = \"127.0.0.1:4000\"\nhttp = \"127.0.0.1:4000\"\n"),
              HasSubstr("http: \"127.0.0.1:4000\" is the port of listen"));
  EXPECT_THAT(errorOf("insecure = true\nlisten = \"0.0.0.0:4000\"\nhttp = \"127.0.0.1:4000\"\n"),
              HasSubstr("use another port"));
  EXPECT_EQ(errorOf("listen = \"127.0.0.1:4000\"\nhttp = \"127.0.0.2:4000\"\n"), "");
  EXPECT_EQ(errorOf("listen = \"127.0.0.1:0\"\nhttp = \"127.0.0.1:0\"\n"), "");
  EXPECT_THAT(errorOf("[[device]]\nworkspace = [0, 0, 0, 1e-300, 100, 100]\n"),
              HasSubstr("workspace: an edge of 1e-300 mm is too short; use 1 mm or more"));
}

TEST(Config, LimitsHaveOneTableAndNameValueAndRemedy) {
  EXPECT_EQ(parseConfig("[limits]\nobjects = 5\n", "test.toml").limits.objects, 5);
  EXPECT_EQ(errorOf("connections = 5"), "test.toml:1: 'connections' belongs in [limits]");
  EXPECT_EQ(errorOf("[[device]]\neffects = 5"),
            "test.toml:2: 'effects' belongs in [limits], which belongs above the first [[device]]");
  EXPECT_EQ(errorOf("[limits]\nlisten = \"127.0.0.1\""), "test.toml:2: 'listen' belongs outside [limits]");
  EXPECT_EQ(errorOf("[compat]\nobjects = 5"), "test.toml:2: 'objects' belongs in [limits]");
  EXPECT_EQ(errorOf("limits = 3"), "test.toml:1: 'limits' must be a table: [limits]");
  EXPECT_EQ(errorOf("[limits]\nmemory = 3"), "test.toml:2: unknown key 'memory'; did you mean 'memory_MB'?");
  EXPECT_EQ(errorOf("[limits]\nobjects = 100000"),
            "test.toml:2: objects must be between 1 and 10000, got 100000");
  EXPECT_EQ(errorOf("[limits]\nmemory_MB = 100\n\nclient_memory_MB = 200"),
            "test.toml:4: client_memory_MB must be between 32 and 100, got 200");
}

TEST(Config, DevicesThatShareASceneShareItsControl) {
  const std::string shared = "[[device]]\nname = \"A\"\nscene = \"s\"\n";
  const std::string other = "[[device]]\nname = \"B\"\nscene = \"s\"\n";
  EXPECT_EQ(errorOf(shared + other), "");
  EXPECT_THAT(errorOf(shared + other + "control = \"first\"\n"),
              HasSubstr("all devices of the scene 's' must have the same control"));
  const std::string listed = "control = \"list\"\ncontrol_list = [\"10.0.0.5\"]\n";
  EXPECT_EQ(errorOf(shared + listed + other + listed), "");
  EXPECT_THAT(errorOf(shared + listed + other + "control = \"list\"\ncontrol_list = [\"10.0.0.6\"]\n"),
              HasSubstr("must have the same control_list"));
}

TEST(Config, AWrittenConfigurationReadsBackEqual) {
  EXPECT_EQ(parseConfig(toToml(ServerConfig{}), "written"), ServerConfig{});
  const ServerConfig config = unusual();
  const std::string text = toToml(config);
  EXPECT_EQ(parseConfig(text, "written"), config) << text;
  EXPECT_EQ(toToml(parseConfig(text, "written")), text);
  EXPECT_NE(text.find("linear_tolerance_mm = 0.3\n"), std::string::npos) << text;
  EXPECT_NE(text.find("workspace = \"paper\"\n"), std::string::npos) << text;
}

// Thousandths are stored as a product that rounds: the text is of a factor that gives the same one.
TEST(Config, WrittenThousandthsReadBackEqual) {
  for (const char* number :
       {"31.3249868150241", "43.24931612966545", "25.267868904448388", "20.937448660194075",
        "39.66989755440065", "1.9303672346150325", "28.31554444268709", "0.30000000000000004", "5e-324",
        "1e-310", "49.999999999999993"}) {
    const ServerConfig config =
        parseConfig("[[device]]\ntool_radius_mm = " + std::string(number) + "\n", "test.toml");
    const std::string text = toToml(config);
    EXPECT_EQ(parseConfig(text, "written"), config) << number << "\n" << text;
    EXPECT_EQ(toToml(parseConfig(text, "written")), text) << number;
  }
}

// The test above relies on this to notice any key that is not written, not read, or confused with another.
TEST(Config, EveryKeyOfTheUnusualConfigurationDiffersFromItsDefault) {
  std::istringstream usual(toToml(ServerConfig{}));
  std::string unusualText = toToml(unusual());
  unusualText.resize(unusualText.rfind("[[device]]"));
  int keys = 0;
  for (std::string line; std::getline(usual, line);) {
    // The second device has an unusual hand: no driver reads hardware and hand.
    if (line.find(" = ") == std::string::npos || line.starts_with("hand = ")) continue;
    ++keys;
    EXPECT_EQ(unusualText.find(line + "\n"), std::string::npos) << line;
  }
  EXPECT_GE(keys, 30);
}

TEST(Config, BlackBoxesDefaultToTheStateDirectoryOfTheUser) {
  const auto with = [](const char* state, const char* home) {
    state != nullptr ? setenv("XDG_STATE_HOME", state, 1) : unsetenv("XDG_STATE_HOME");
    home != nullptr ? setenv("HOME", home, 1) : unsetenv("HOME");
    return defaultBlackBoxDir().string();
  };
  const char* before = std::getenv("HOME");
  const std::string home = before != nullptr ? before : "/";
  EXPECT_EQ(with("/state", "/home/ana"), "/state/hapticd");
  EXPECT_EQ(with("relative", "/home/ana"), "/home/ana/.local/state/hapticd");
  EXPECT_EQ(with(nullptr, "/home/ana"), "/home/ana/.local/state/hapticd");
  EXPECT_EQ(with("", "/home/ana"), "/home/ana/.local/state/hapticd");
  EXPECT_EQ(std::filesystem::path(with(nullptr, nullptr)).filename(), "hapticd");
  setenv("HOME", home.c_str(), 1);
}

TEST(Config, ListenAcceptsAddressPortOrBoth) {
  std::string address = "127.0.0.1";
  std::uint16_t port = 3883;
  parseListen(":4000", address, port);
  EXPECT_EQ(address, "127.0.0.1");
  EXPECT_EQ(port, 4000);
  parseListen("0.0.0.0", address, port);
  EXPECT_EQ(address, "0.0.0.0");
  EXPECT_EQ(port, 4000);
  for (const char* text : {"::1", "[::1]", "[::1]:4000", "fe80::1:2", "::", "1:2:3"}) {
    try {
      parseListen(text, address, port);
      ADD_FAILURE() << text;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find("'" + std::string(text) + "' is an IPv6 address"),
                std::string::npos)
          << error.what();
    }
  }
  EXPECT_EQ(address, "0.0.0.0");
  EXPECT_EQ(port, 4000);
  EXPECT_THROW(parseListen("host:", address, port), ConfigError);
  EXPECT_THROW(parseListen("host:12x", address, port), ConfigError);
}

}  // namespace
}  // namespace hapticd::server
