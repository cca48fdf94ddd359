// A Fast DDS process that subscribes to topics and calls services as rmw_fastrtps does, with payloads as bytes.
//
//     peer subscribe TOPIC TYPE [--best-effort] [--transient-local] [--depth N] [--seconds S] [--samples N]
//         [--linger S] [--joins N] [--lease S] [--shared-memory] [--beside]
//     peer call SERVICE REQUEST_TYPE RESPONSE_TYPE HEX [--timeout S] [--clients N] [--heartbeat S]
//
// Both take --domain D. TOPIC and SERVICE are names on the wire without their prefixes: "rt/", or "rq/" and "rr/".
// HEX is the request's body, little-endian, without the four bytes of the encapsulation.
//
// The transport is UDP, the only one of the publisher. With --shared-memory the transports are those that Fast DDS has
// by default, shared memory and UDP. Fast DDS 2.9.1 at times crashes when it closes its shared memory.
//
// `subscribe` prints a JSON line for each sample, one when the subscriber exists, and one when it is matched with a
// publisher. `subscribe` prints another when the subscriber has ended, with the quality of service that the publisher
// offers. With --beside a volatile subscriber of the same topic stands beside in the process, and the last line has the
// number of its samples. The subscriber ends after S seconds, or some time after N samples. With --joins that happens N times, each
// with a participant of its own. `call` makes the first call of N new clients, each with a participant that knows the
// server before, and prints a JSON line for each.

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/log/StdoutErrConsumer.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using eprosima::fastrtps::types::ReturnCode_t;
using Clock = std::chrono::steady_clock;

namespace {

using Bytes = std::vector<uint8_t>;

// The largest payload: a stage or a path.
constexpr uint32_t most_bytes = 4 << 20;

[[noreturn]] void fail(const std::string& reason) {
  std::fprintf(stderr, "error: %s\n", reason.c_str());
  std::exit(2);
}

// A type whose samples are payloads, encapsulation included.
class Opaque : public TopicDataType {
public:
  explicit Opaque(const std::string& name) {
    setName(name.c_str());
    m_typeSize = most_bytes;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<Bytes*>(data);
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }

  bool deserialize(SerializedPayload_t* payload, void* data) override {
    static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }

  std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
  }

  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

// The arguments after the positional ones.
struct Options {
  uint32_t domain = 0;
  bool reliable = true;
  bool transient_local = false;
  bool shared_memory = false;
  bool beside = false;
  int depth = 10;
  int joins = 1;
  int clients = 1;
  uint64_t samples = UINT64_MAX;
  double seconds = 10.0;
  double linger = 0.5;
  double timeout = 10.0;
  // The default of Fast DDS.
  double heartbeat = 3.0;
  double lease = 20.0;

  Options(int first, int count, char** arguments) {
    for (int i = first; i < count; i++) {
      const std::string option = arguments[i];
      if (option == "--best-effort") {
        reliable = false;
      } else if (option == "--transient-local") {
        transient_local = true;
      } else if (option == "--shared-memory") {
        shared_memory = true;
      } else if (option == "--beside") {
        beside = true;
      } else if (i + 1 == count) {
        fail("unexpected argument " + option);
      } else {
        const double value = std::atof(arguments[++i]);
        if (option == "--domain") domain = static_cast<uint32_t>(value);
        else if (option == "--depth") depth = static_cast<int>(value);
        else if (option == "--joins") joins = static_cast<int>(value);
        else if (option == "--clients") clients = static_cast<int>(value);
        else if (option == "--samples") samples = static_cast<uint64_t>(value);
        else if (option == "--seconds") seconds = value;
        else if (option == "--linger") linger = value;
        else if (option == "--timeout") timeout = value;
        else if (option == "--heartbeat") heartbeat = value;
        else if (option == "--lease") lease = value;
        else fail("unexpected argument " + option);
      }
    }
  }
};

// Notes the topics of discovered readers and writers, and wakes a waiting thread at every event.
class Events : public DomainParticipantListener {
public:
  void on_subscriber_discovery(DomainParticipant*, eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& found) override {
    note("reads " + found.info.topicName().to_string());
  }

  void on_publisher_discovery(DomainParticipant*, eprosima::fastrtps::rtps::WriterDiscoveryInfo&& found) override {
    const std::string topic = found.info.topicName().to_string();
    const auto& qos = found.info.m_qos;
    const bool is_reliable = qos.m_reliability.kind == RELIABLE_RELIABILITY_QOS;
    const bool is_transient_local = qos.m_durability.kind == TRANSIENT_LOCAL_DURABILITY_QOS;
    {
      const std::lock_guard<std::mutex> guard(lock);
      offers[topic] = std::string(is_reliable ? "reliable " : "best_effort ") +
                      (is_transient_local ? "transient_local" : "volatile");
    }
    note("writes " + topic);
  }

  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    const std::lock_guard<std::mutex> guard(lock);
    writers = status.current_count;
    changed.notify_all();
  }

  void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
    const std::lock_guard<std::mutex> guard(lock);
    readers = status.current_count;
    changed.notify_all();
  }

  void on_data_available(DataReader*) override {
    const std::lock_guard<std::mutex> guard(lock);
    data = true;
    changed.notify_all();
  }

  // Waits until `is_true`, called under the lock, or until the deadline.
  template <typename Condition>
  bool wait(Clock::time_point deadline, Condition is_true) {
    std::unique_lock<std::mutex> guard(lock);
    return changed.wait_until(guard, deadline, is_true);
  }

  bool knows(const std::string& what) const { return known.count(what) > 0; }

  // Returns the reliability and durability of the latest writer of a topic, as discovery reports them.
  std::string offered(const std::string& topic) {
    const std::lock_guard<std::mutex> guard(lock);
    return offers[topic];
  }

  bool take_data() { return std::exchange(data, false); }

  int readers = 0;
  int writers = 0;

private:
  void note(const std::string& what) {
    const std::lock_guard<std::mutex> guard(lock);
    known.insert(what);
    changed.notify_all();
  }

  std::mutex lock;
  std::condition_variable changed;
  std::set<std::string> known;
  std::map<std::string, std::string> offers;
  bool data = false;
};

// A participant with all that belongs to it.
class Peer {
public:
  Peer(const Options& options, Events& events) : options(options), events(events) {
    DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
    qos.wire_protocol().builtin.discovery_config.leaseDuration = options.lease;
    if (!options.shared_memory) {
      qos.transport().use_builtin_transports = false;
      qos.transport().user_transports.push_back(std::make_shared<UDPv4TransportDescriptor>());
    }
    participant = DomainParticipantFactory::get_instance()->create_participant(options.domain, qos, &events,
                                                                               StatusMask::none());
    if (!participant) fail("no participant");
    publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  }

  ~Peer() {
    participant->set_listener(nullptr);
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
  }

  DataReader* reader(const std::string& name, const std::string& type) {
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    settle(qos);
    auto* reader = subscriber->create_datareader(topic(name, type), qos, &events);
    if (!reader) fail("no reader of " + name);
    return reader;
  }

  // Another reader of the same topic, volatile.
  DataReader* beside(DataReader* reader) {
    DataReaderQos qos = reader->get_qos();
    qos.durability().kind = VOLATILE_DURABILITY_QOS;
    auto* other = subscriber->create_datareader(const_cast<TopicDescription*>(reader->get_topicdescription()), qos);
    if (!other) fail("no second reader");
    return other;
  }

  DataWriter* writer(const std::string& name, const std::string& type) {
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    settle(qos);
    qos.reliable_writer_qos().times.heartbeatPeriod = options.heartbeat;
    auto* writer = publisher->create_datawriter(topic(name, type), qos, &events);
    if (!writer) fail("no writer of " + name);
    return writer;
  }

private:
  // As rmw_fastrtps does: memory grows with the messages, and no data sharing.
  template <typename Qos>
  void settle(Qos& qos) {
    qos.reliability().kind = options.reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = options.transient_local ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = options.depth;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    qos.data_sharing().off();
  }

  Topic* topic(const std::string& name, const std::string& type) {
    TypeSupport(new Opaque(type)).register_type(participant);
    auto* topic = participant->create_topic(name, type, TOPIC_QOS_DEFAULT);
    if (!topic) fail("no topic " + name);
    return topic;
  }

  const Options& options;
  Events& events;
  DomainParticipant* participant;
  Publisher* publisher;
  Subscriber* subscriber;
};

double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

Clock::time_point in(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

long long wall_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

std::string hex(const Bytes& bytes, size_t first) {
  std::string text;
  char digits[3];
  for (size_t i = first; i < bytes.size(); i++) {
    std::snprintf(digits, sizeof digits, "%02x", bytes[i]);
    text += digits;
  }
  return text;
}

void subscribe(const std::string& name, const std::string& type, const Options& options) {
  for (int join = 0; join < options.joins; join++) {
    Events events;
    const long long made = wall_ns();
    Peer peer(options, events);
    auto* reader = peer.reader("rt/" + name, type);
    auto* other = options.beside ? peer.beside(reader) : nullptr;
    std::printf("{\"type\":\"made\",\"made_ns\":%lld}\n", made);
    std::fflush(stdout);
    uint64_t samples = 0;
    bool is_matched = false;
    auto end = in(options.seconds);
    while (events.wait(end, [&] { return events.take_data() || (!is_matched && events.writers > 0); })) {
      // A message is proof of a match, and may come before its event.
      if (!is_matched) {
        is_matched = true;
        std::printf("{\"type\":\"matched\"}\n");
        std::fflush(stdout);
      }
      Bytes bytes;
      SampleInfo info;
      while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
        if (!info.valid_data) continue;
        samples++;
        // The content of frames and paths is not printed.
        const std::string content = bytes.size() <= 1024 ? hex(bytes, 4) : "";
        std::printf("{\"type\":\"sample\",\"received_ns\":%lld,\"source_ns\":%lld,\"sequence\":%llu,\"bytes\":%zu,"
                    "\"hex\":\"%s\"}\n",
                    wall_ns(), static_cast<long long>(info.source_timestamp.to_ns()),
                    static_cast<unsigned long long>(info.sample_identity.sequence_number().to64long()), bytes.size(),
                    content.c_str());
        std::fflush(stdout);
        if (samples == options.samples) end = std::min(end, in(options.linger));
      }
    }
    unsigned beside = 0;
    Bytes bytes;
    SampleInfo info;
    while (other && other->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) beside += info.valid_data;
    std::printf("{\"type\":\"end\",\"made_ns\":%lld,\"samples\":%llu,\"writers\":%d,\"offered\":\"%s\",\"beside\":%u}\n",
                made, static_cast<unsigned long long>(samples), events.writers, events.offered("rt/" + name).c_str(),
                beside);
    std::fflush(stdout);
  }
}

Bytes request_of(const std::string& text) {
  Bytes bytes = {0, 1, 0, 0};
  if (text.size() % 2) fail("HEX has an odd number of digits");
  for (size_t i = 0; i < text.size(); i += 2) {
    bytes.push_back(static_cast<uint8_t>(std::strtoul(text.substr(i, 2).c_str(), nullptr, 16)));
  }
  return bytes;
}

void call(const std::string& service, const std::string& request_type, const std::string& response_type,
          const std::string& body, const Options& options) {
  const std::string requests = "rq/" + service + "Request";
  const std::string responses = "rr/" + service + "Reply";
  for (int client = 0; client < options.clients; client++) {
    Events events;
    Peer peer(options, events);
    // A node has usually known the server for a while when it creates a client.
    const auto is_known = [&] { return events.knows("reads " + requests) && events.knows("writes " + responses); };
    if (!events.wait(in(60.0), is_known)) fail("no server of " + service);
    const auto start = Clock::now();
    auto* reader = peer.reader(responses, response_type);
    auto* writer = peer.writer(requests, request_type);
    const auto is_matched = [&] { return events.readers > 0 && events.writers > 0; };
    if (!events.wait(in(60.0), is_matched)) fail("no match with " + service);
    const double discovered = since(start);
    Bytes request = request_of(body);
    eprosima::fastrtps::rtps::WriteParams parameters;
    parameters.related_sample_identity().writer_guid() = reader->guid();
    const auto sent = Clock::now();
    const auto deadline = in(options.timeout);
    if (!writer->write(&request, parameters)) fail("the request was not written");
    const auto identity = parameters.sample_identity();
    std::string answer = "null";
    double answered = 0.0;
    while (answer == "null" && events.wait(deadline, [&] { return events.take_data(); })) {
      Bytes bytes;
      SampleInfo info;
      while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
        const auto& related = info.related_sample_identity;
        const bool is_ours = related.writer_guid() == reader->guid() || related.writer_guid() == writer->guid();
        if (info.valid_data && is_ours && related.sequence_number() == identity.sequence_number()) {
          answered = since(sent);
          answer = "\"" + hex(bytes, 4) + "\"";
        }
      }
    }
    std::printf("{\"discovered_s\":%.4f,\"answered_s\":%.4f,\"response\":%s}\n", discovered, answered, answer.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

int main(int count, char** arguments) {
  // Fast DDS prints its errors on standard output, where the lines of JSON are.
  Log::ClearConsumers();
  Log::RegisterConsumer(std::make_unique<StdoutErrConsumer>());
  const std::string command = count > 1 ? arguments[1] : "";
  if (command == "subscribe" && count >= 4) {
    subscribe(arguments[2], arguments[3], Options(4, count, arguments));
  } else if (command == "call" && count >= 6) {
    call(arguments[2], arguments[3], arguments[4], arguments[5], Options(6, count, arguments));
  } else {
    fail("expected `subscribe TOPIC TYPE` or `call SERVICE REQUEST_TYPE RESPONSE_TYPE HEX`");
  }
}
