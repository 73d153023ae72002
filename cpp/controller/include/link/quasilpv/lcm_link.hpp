// LCM over UDP multicast: the transport between two processes.
#pragma once

#include <memory>
#include <string>

#include "quasilpv/link.hpp"

namespace quasilpv {

/// This machine only: a packet with a time to live of 0 never leaves it.
inline constexpr const char* kDefaultLcmUrl = "udpm://239.255.76.67:7667?ttl=0";

/// Throws InputError if `url` is not of the form `udpm://ADDRESS:PORT?ttl=N`. INIT-ONLY.
void check_lcm_url(const std::string& url);

/// Which channels an LcmLink listens to.
enum class Listen { kPeer, kNothing };

/// A Link over LCM. Messages are encoded into a buffer of its own and published from it. LCM has no authentication:
/// identity and checksum catch accidents, not attackers.
class LcmLink final : public Link {
 public:
  /// INIT-ONLY. Throws InputError if `url` is not `udpm://ADDRESS:PORT?ttl=N` or has a ttl above 0 without
  /// `allow_network`; TransportError, with the command that helps, if this machine has no route for multicast.
  ///
  /// @param listen  kPeer: what the other side sends; kNothing: only sends
  LcmLink(Side side, const WireIdentity& identity, const std::string& url, bool allow_network,
          Listen listen = Listen::kPeer);
  ~LcmLink() override;

 private:
  class Connection;

  bool transmit(Channel channel, const void* bytes, std::size_t size) noexcept override;
  bool drain(std::int64_t timeout_ns) noexcept override;

  std::unique_ptr<Connection> connection_;
};

}  // namespace quasilpv
