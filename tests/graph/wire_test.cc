// Edits and solutions as bytes: the same on the other side, and an error where they are damaged.
#include <gtest/gtest.h>

#include <random>

#include "graph/random_graph.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/graph/wire.h"

namespace oriel {
namespace {

using testing_graph::random_graph_types;
using testing_graph::RandomGraph;

Bytes bytes_of(const GraphEdit& edit) {
  Bytes out;
  append_edit(out, edit);
  return out;
}

Result<void> read(const Bytes& bytes, const TypeList& types, const Graph& target, GraphEdit& edit) {
  auto message = read_message(bytes);
  if (!message) return message.error();
  return read_edit(*message, types, target, edit);
}

// The payload with one byte changed, under a checksum that fits: what only the checks of the reader can find.
Bytes tampered(const Bytes& bytes, std::size_t at, std::byte value) {
  Bytes out;
  append_message(out, kEditMessage, [&](ByteWriter& w) {
    for (std::size_t i = Message::kHeaderBytes; i < bytes.size(); ++i)
      w.put(static_cast<std::uint8_t>(i == at ? value : bytes[i]));
  });
  return out;
}

TEST(Wire, CarriesRandomEditsToAGraphThatBecomesEqual) {
  const TypeList types = random_graph_types();
  for (unsigned seed = 1; seed <= 4; ++seed) {
    RandomGraph origin(seed, true);
    const Subscription s = origin.graph.subscribe();
    Graph follower;
    GraphEdit net, received;
    for (int round = 0; round < 200; ++round) {
      ASSERT_TRUE(origin.step(8));
      if (origin.below(3) > 0) continue;
      origin.graph.collect(s, net);
      const auto ok = read(bytes_of(net), types, follower, received);
      ASSERT_TRUE(ok) << ok.error();
      const auto applied = follower.apply(received);
      ASSERT_TRUE(applied) << applied.error();
      ASSERT_EQ(fingerprint(follower), fingerprint(origin.graph)) << "seed " << seed << ", round " << round;
    }
    for (const auto& v : origin.variables()) {
      if (follower.find_value(v.id) == nullptr) continue;  // it has not looked since
      EXPECT_EQ(follower.describe(v.id), origin.graph.describe(v.id));
    }
  }
}

TEST(Wire, CarriesASolutionAndItsVersion) {
  TypeList types = random_graph_types();
  Solution s;
  s.version = 12345678901234;
  Solution::Column& c = s.columns.emplace_back();
  c.ops = &kVariableOps<Point3d>;
  c.values = ByteColumn(sizeof(Point3d));
  for (std::uint32_t i = 0; i < 5; ++i) {
    const Point3d p{{{0.1 * i, -0.0, 1e300}}};
    c.keys.push_back({i, i + 1});
    c.values.push_back(&p);
  }
  Bytes bytes;
  append_solution(bytes, s);
  const auto message = read_message(bytes);
  ASSERT_TRUE(message);
  Solution got;
  ASSERT_TRUE(read_solution(*message, types, got));
  EXPECT_EQ(got.version, s.version);
  ASSERT_EQ(got.columns.size(), 1u);
  EXPECT_EQ(got.columns[0].keys, c.keys);
  EXPECT_EQ(std::memcmp(got.columns[0].values.data(), c.values.data(), 5 * sizeof(Point3d)), 0);
}

TEST(Wire, ReadsASolutionInPlaceOfAnotherAndOfNothingWhereItIsDamaged) {
  const TypeList types = random_graph_types();
  const auto column_of = [](const VariableOps& ops, std::uint32_t n) {
    Solution::Column c;
    c.ops = &ops;
    c.values = ByteColumn(ops.bytes);
    const std::vector<std::byte> value(ops.bytes, std::byte{7});
    for (std::uint32_t i = 0; i < n; ++i) c.keys.push_back({i, 1}), c.values.push_back(value.data());
    return c;
  };
  const VariableOps &point = kVariableOps<Point3d>, &pose = kVariableOps<Pose3d>;
  std::vector<Solution> solutions(4);
  solutions[0].columns = {column_of(pose, 9), column_of(point, 3)};
  solutions[1].columns = {column_of(point, 4), column_of(pose, 2)};
  solutions[2].columns = {column_of(pose, 1)};
  solutions[3].columns = {column_of(pose, 12), column_of(point, 1)};
  Solution got;
  for (const Solution& s : solutions) {
    Bytes bytes;
    append_solution(bytes, s);
    ASSERT_TRUE(read_solution(*read_message(bytes), types, got));
    ASSERT_EQ(got.columns.size(), s.columns.size());
    for (std::size_t k = 0; k < s.columns.size(); ++k) {
      EXPECT_EQ(got.columns[k].ops, s.columns[k].ops);
      EXPECT_EQ(got.columns[k].keys, s.columns[k].keys);
      ASSERT_EQ(got.columns[k].values.size(), s.columns[k].values.size());
      EXPECT_EQ(std::memcmp(got.columns[k].values.data(), s.columns[k].values.data(),
                            s.columns[k].values.size() * s.columns[k].ops->bytes),
                0);
    }
    Message cut = *read_message(bytes);
    cut.payload = cut.payload.first(cut.payload.size() - 1);
    Solution damaged = got;
    EXPECT_FALSE(read_solution(cut, types, damaged));
    EXPECT_TRUE(damaged.columns.empty());
  }
}

TEST(Wire, NamesATypeThatTheReaderDoesNotKnow) {
  RandomGraph origin(3, true);
  for (int i = 0; i < 40; ++i) ASSERT_TRUE(origin.step(6));
  GraphEdit net, received;
  origin.graph.collect(origin.graph.subscribe(), net);
  TypeList few;
  few.variable<Point3d>().variable<Pose3d>().variable<Velocity3d>();
  Graph follower;
  const auto ok = read(bytes_of(net), few, follower, received);
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, ErrorCode::not_found);
  EXPECT_NE(ok.error().message.find("noise, which the reader does not know"), std::string::npos) << ok.error();
  EXPECT_TRUE(received.empty());
}

TEST(Wire, RefusesAMessageThatIsCutShortAnywhere) {
  const TypeList types = random_graph_types();
  RandomGraph origin(5);
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(origin.step(6));
  GraphEdit net, received;
  origin.graph.collect(origin.graph.subscribe(), net);
  const Bytes bytes = bytes_of(net);
  Graph follower;
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    EXPECT_FALSE(read(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n)), types, follower, received));
    if (n < Message::kHeaderBytes) continue;
    Bytes cut;  // the same, with a header that fits
    append_message(cut, kEditMessage, [&](ByteWriter& w) {
      w.put_bytes(bytes.data() + Message::kHeaderBytes, n - Message::kHeaderBytes);
    });
    EXPECT_FALSE(read(cut, types, follower, received)) << n;
    EXPECT_TRUE(received.empty());
  }
}

TEST(Wire, FindsEveryChangedByteByItsChecksum) {
  const TypeList types = random_graph_types();
  RandomGraph origin(6);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(origin.step(6));
  GraphEdit net, received;
  origin.graph.collect(origin.graph.subscribe(), net);
  Bytes bytes = bytes_of(net);
  Graph follower;
  for (std::byte& b : bytes) {
    b ^= std::byte{0x10};
    EXPECT_FALSE(read(bytes, types, follower, received));
    b ^= std::byte{0x10};
  }
  EXPECT_TRUE(read(bytes, types, follower, received));
}

// Whatever a message says: an error, or an edit that the graph takes or refuses; no crash, no memory out of proportion.
TEST(Wire, SurvivesAnyByteWithAChecksumThatFits) {
  const TypeList types = random_graph_types();
  std::mt19937 random(7);
  int refused_by_reader = 0, refused_by_graph = 0, taken = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    RandomGraph origin(seed, true);
    const Subscription s = origin.graph.subscribe();
    for (int i = 0; i < 12; ++i) ASSERT_TRUE(origin.step(6));
    GraphEdit first, second, received;
    origin.graph.collect(s, first);
    for (int i = 0; i < 12; ++i) ASSERT_TRUE(origin.step(6));
    origin.graph.collect(s, second);
    const Bytes base = bytes_of(first), bytes = bytes_of(second);
    for (int trial = 0; trial < 3000; ++trial) {
      Graph follower;
      ASSERT_TRUE(read(base, types, follower, received));
      ASSERT_TRUE(follower.apply(received));
      const std::size_t at = Message::kHeaderBytes + random() % (bytes.size() - Message::kHeaderBytes);
      const std::uint64_t before = fingerprint(follower);
      if (!read(tampered(bytes, at, static_cast<std::byte>(random() % 256)), types, follower, received)) {
        ++refused_by_reader;
        EXPECT_EQ(fingerprint(follower), before);
      } else if (!follower.apply(received)) {
        ++refused_by_graph;
        EXPECT_EQ(fingerprint(follower), before);
      } else {
        ++taken;  // a value or a measurement that is another one
      }
    }
  }
  EXPECT_GT(refused_by_reader, 100);
  EXPECT_GT(refused_by_graph, 100);
  EXPECT_GT(taken, 100);
}

}  // namespace
}  // namespace oriel
