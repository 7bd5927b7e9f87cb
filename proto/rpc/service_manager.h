#pragma once
// What a program tells the service manager that started it: systemd, for a unit of Type=notify.

#include <string>

namespace calib::rpc {

inline constexpr char kReady[] = "READY=1";
inline constexpr char kStopping[] = "STOPPING=1";

/// Sends lines of sd_notify(3) as one datagram to $NOTIFY_SOCKET, a path or, after '@', a name of
/// the kernel's own. Nothing is done where it is not set, nothing said where nobody hears it: what
/// the program does depends on neither.
void TellServiceManager(const std::string& lines);

}  // namespace calib::rpc
