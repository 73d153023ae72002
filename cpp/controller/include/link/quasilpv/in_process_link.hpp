// The twin of LCM within one process: tests and studies without a network.
#pragma once

#include <memory>
#include <utility>

#include "quasilpv/link.hpp"

namespace quasilpv {

/// Two ends connected by bounded queues; each end may live on a thread of its own. Packets pass through the same
/// encoding and the same checks as on the network. A full queue drops the newest packet, as LCM does. Telemetry has no
/// listener here and is discarded.
class InProcessLink final : public Link {
 public:
  static constexpr std::size_t kQueueCapacity = 64;

  /// Both ends of one wire: first the controller's, then the plant's. INIT-ONLY.
  static std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> create_pair(
      const WireIdentity& identity);
  ~InProcessLink() override;

  /// Puts raw bytes into this end's own queue, as if the other side had sent them: fault injection. RT-UNSAFE.
  void inject(Channel channel, const void* bytes, std::size_t size);

 private:
  class Queue;

  InProcessLink(Side side, const WireIdentity& identity, std::shared_ptr<Queue> incoming,
                std::shared_ptr<Queue> outgoing);
  bool transmit(Channel channel, const void* bytes, std::size_t size) noexcept override;
  bool drain(std::int64_t timeout_ns) noexcept override;

  std::shared_ptr<Queue> incoming_;
  std::shared_ptr<Queue> outgoing_;
};

}  // namespace quasilpv
