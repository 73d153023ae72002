#include "quasilpv/in_process_link.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>

namespace quasilpv {

class InProcessLink::Queue {
 public:
  struct Entry {
    Channel channel = Channel::kEvent;
    Packet packet;
  };

  bool push(Channel channel, const void* bytes, std::size_t size) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (count_ == kQueueCapacity || size > kMaxMessageBytes) {
        return false;
      }
      Entry& entry = entries_[(first_ + count_) % kQueueCapacity];
      entry.channel = channel;
      std::memcpy(entry.packet.bytes.data(), bytes, size);
      entry.packet.size = static_cast<int>(size);
      ++count_;
    }
    arrived_.notify_one();
    return true;
  }

  bool pop(Entry& entry, std::int64_t timeout_ns) {
    std::unique_lock<std::mutex> lock(mutex_);
    // A poll must not enter the timed wait: that costs a trip through the scheduler.
    const auto has_packet = [this] { return count_ > 0; };
    if (!has_packet() &&
        (timeout_ns <= 0 || !arrived_.wait_for(lock, std::chrono::nanoseconds(timeout_ns), has_packet))) {
      return false;
    }
    entry = entries_[first_];
    first_ = (first_ + 1) % kQueueCapacity;
    --count_;
    return true;
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::array<Entry, kQueueCapacity> entries_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

InProcessLink::InProcessLink(Side side, const WireIdentity& identity, std::shared_ptr<Queue> incoming,
                             std::shared_ptr<Queue> outgoing)
    : Link(side, identity), incoming_(std::move(incoming)), outgoing_(std::move(outgoing)) {}

InProcessLink::~InProcessLink() = default;

std::pair<std::unique_ptr<InProcessLink>, std::unique_ptr<InProcessLink>> InProcessLink::create_pair(
    const WireIdentity& identity) {
  auto to_controller = std::make_shared<Queue>();
  auto to_plant = std::make_shared<Queue>();
  std::unique_ptr<InProcessLink> controller(new InProcessLink(Side::kController, identity, to_controller, to_plant));
  std::unique_ptr<InProcessLink> plant(new InProcessLink(Side::kPlant, identity, to_plant, to_controller));
  return {std::move(controller), std::move(plant)};
}

void InProcessLink::inject(Channel channel, const void* bytes, std::size_t size) {
  incoming_->push(channel, bytes, size);
}

bool InProcessLink::transmit(Channel channel, const void* bytes, std::size_t size) noexcept {
  const bool unheard = channel == Channel::kTelemetry || channel == Channel::kSignalsTelemetry;
  return unheard || outgoing_->push(channel, bytes, size);
}

bool InProcessLink::drain(std::int64_t timeout_ns) noexcept {
  Queue::Entry entry;
  bool any = false;
  while (incoming_->pop(entry, any ? 0 : timeout_ns)) {
    accept(entry.channel, entry.packet.bytes.data(), static_cast<std::size_t>(entry.packet.size));
    any = true;
  }
  return any;
}

}  // namespace quasilpv
