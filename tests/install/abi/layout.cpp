// Prints size and alignment of every public struct and class, one per line, for abi_test.sh.
#include <cstdio>

#include "hapticd/client.h"
#include "hapticd/vrpn/vrpn_Analog.h"
#include "hapticd/vrpn/vrpn_Button.h"
#include "hapticd/vrpn/vrpn_Connection.h"
#include "hapticd/vrpn/vrpn_Dial.h"
#include "hapticd/vrpn/vrpn_ForceDevice.h"
#include "hapticd/vrpn/vrpn_Text.h"
#include "hapticd/vrpn/vrpn_Tracker.h"

namespace {

template <class T>
void print(const char* name) {
  std::printf("%s size %zu alignment %zu\n", name, sizeof(T), alignof(T));
}

}  // namespace

#define PRINT(T) print<T>(#T);

int main() {
  PRINT(hapticd::Client)
  PRINT(hapticd::ClientOptions)
  PRINT(hapticd::UploadProgress)
  PRINT(hapticd::Subscription)
  PRINT(hapticd::ScopedSubscription)
  PRINT(hapticd::Trip)
  PRINT(hapticd::Trips)
  PRINT(hapticd::TripInfo)
  PRINT(hapticd::ForceError)
  PRINT(hapticd::Severity)
  PRINT(hapticd::ReportKind)
#define PRINT_REPORT(name, Type, text) print<hapticd::Type##Report>("hapticd::" #Type "Report");
  HAPTICD_REPORTS(PRINT_REPORT)
  PRINT(hapticd::ConnectionReport)
  PRINT(hapticd::Contact)
  PRINT(hapticd::RemoteContact)
  PRINT(hapticd::RemoteShape)
  PRINT(hapticd::RemoteContactForce)
  PRINT(hapticd::LatestReports)
  PRINT(hapticd::LatencyHistogram)
  PRINT(hapticd::ReportStatistics)
  PRINT(hapticd::Statistics)
  PRINT(hapticd::Capabilities)
  PRINT(hapticd::Reports)
  PRINT(hapticd::HandPose)
  PRINT(hapticd::Surface)
  PRINT(hapticd::Box)
  PRINT(hapticd::MeshView)
  PRINT(hapticd::Faces)
  PRINT(hapticd::ButtonMode)
  PRINT(hapticd::EffectType)
  PRINT(hapticd::Effect)
  PRINT(hapticd::ForceField)
  PRINT(hapticd::Plane)
  PRINT(hapticd::PlaneTexture)
  PRINT(hapticd::Error)

  PRINT(vrpn_HANDLERPARAM)
  PRINT(vrpn_Connection)
  PRINT(vrpn_TextPrinter)
  PRINT(vrpn_BaseClass)
  PRINT(vrpn_ANALOGCB)
  PRINT(vrpn_Analog_Remote)
  PRINT(vrpn_BUTTONCB)
  PRINT(vrpn_BUTTONSTATESCB)
  PRINT(vrpn_Button_Remote)
  PRINT(vrpn_DIALCB)
  PRINT(vrpn_Dial_Remote)
  PRINT(vrpn_FORCECB)
  PRINT(vrpn_FORCESCPCB)
  PRINT(vrpn_FORCEERRORCB)
  PRINT(vrpn_DOPCB)
  PRINT(vrpn_ISTOUCHINGCB)
  PRINT(vrpn_TOUCHEDOBJECTCB)
  PRINT(vrpn_ANGLECB)
  PRINT(vrpn_ForceDevice_Remote)
  PRINT(vrpn_TEXTCB)
  PRINT(vrpn_Text_Receiver)
  PRINT(vrpn_TRACKERCB)
  PRINT(vrpn_TRACKERVELCB)
  PRINT(vrpn_TRACKERACCCB)
  PRINT(vrpn_TRACKERTRACKER2ROOMCB)
  PRINT(vrpn_TRACKERUNIT2SENSORCB)
  PRINT(vrpn_TRACKERWORKSPACECB)
  PRINT(vrpn_Tracker_Remote)
}
