// What travels between a caller and a worker arrives as it left, or as an error.
#include "oriel/run/transfer.h"

#include <gtest/gtest.h>

#include <random>

#include "oriel/base/matrix.h"

namespace oriel {
namespace {

struct Point {
  double x = 0.0, y = 0.0;
  bool operator==(const Point&) const = default;
};
struct Frame {
  std::int64_t stamp = 0;
  std::vector<Point> points;
  std::string name;
  bool operator==(const Frame&) const = default;
};
struct Input {
  int number = 0;
  std::vector<Frame> frames;
  std::vector<std::vector<float>> weights;
  std::array<std::string, 2> names;
  std::pair<int, std::string> pair;
  bool operator==(const Input&) const = default;
};
struct Views {
  int number = 0;
  std::span<const Point> points;
  double after = 0.0;
};
struct Copied {  // as Views, by value
  int number = 0;
  std::vector<Point> points;
  double after = 0.0;
};
class Closed {
 public:
  Closed() = default;
  explicit Closed(int x) : x_(x), more_(static_cast<std::size_t>(x), 2.5) {}
  template <class Visit>
  void transfer(Visit&& visit) {
    visit(x_, more_);
  }
  bool operator==(const Closed&) const = default;

 private:
  int x_ = 0;
  std::vector<double> more_;
  int cache_ = 0;
};
struct HoldsPointer {
  int n;
  const double* p;
};
struct Derived : Frame {
  int more = 0;
};
struct Nested {
  Frame frame;
  Closed closed;
};

static_assert(Plain<Point> && Plain<int> && Plain<Vec<double, 3>> && Plain<std::array<Point, 3>>);
static_assert(!Plain<Views> && !Plain<Frame> && !Plain<const double*> && !Plain<std::span<const int>>);
static_assert(Transferable<Input> && Transferable<Views> && Transferable<Closed> && Transferable<Nested>);
static_assert(!Transferable<HoldsPointer> && !Transferable<std::vector<bool>> && !Transferable<std::vector<int*>> &&
              !Transferable<std::string_view> && !Transferable<Derived>);
// However deep it is hidden.
struct HoldsHolder {
  int n;
  HoldsPointer holder;
};
struct HoldsMany {
  double x[20];
  int* last;
};
static_assert(!Plain<std::span<double>> && !Plain<std::span<const int, 3>> && !Plain<std::array<int*, 2>> &&
              !Plain<std::optional<const char*>> && !Plain<std::variant<int, int*>> && !Plain<HoldsHolder> &&
              !Plain<HoldsMany> && !Plain<std::reference_wrapper<int>>);
static_assert(!Transferable<std::span<double>> && !Transferable<std::span<const int, 3>> &&
              !Transferable<std::array<int*, 2>> && !Transferable<std::optional<int*>> &&
              !Transferable<std::variant<int, int*>> && !Transferable<HoldsHolder> &&
              !Transferable<std::vector<std::span<double>>>);
static_assert(Plain<std::optional<double>> && Plain<std::variant<int, double>>);

Input random_input(std::mt19937& random) {
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Input in;
  in.number = below(1000);
  in.frames.resize(static_cast<std::size_t>(below(4)));
  for (Frame& f : in.frames) {
    f.stamp = below(1 << 30);
    f.points.resize(static_cast<std::size_t>(below(5)));
    for (Point& p : f.points) p = {0.5 * below(9), -1.0 * below(9)};
    f.name = std::string(static_cast<std::size_t>(below(20)), 'n');
  }
  in.weights.resize(static_cast<std::size_t>(below(3)));
  for (auto& w : in.weights) w.assign(static_cast<std::size_t>(below(7)), 0.25f);
  in.names = {"a", std::string(static_cast<std::size_t>(below(40)), 'b')};
  in.pair = {below(7), "pair"};
  return in;
}

TEST(Transfer, BringsNestedVectorsStringsAndStructsBackAsTheyWere) {
  std::mt19937 random(1);
  Bytes message;
  Input back;
  for (int i = 0; i < 500; ++i) {
    const Input in = random_input(random);
    encode(in, message);
    ASSERT_TRUE(decode(message, back));
    EXPECT_EQ(in, back) << i;
  }
}

TEST(Transfer, LetsASpanLookIntoTheMessageAndNotAtWhatItWasMadeOf) {
  std::vector<Point> points = {{1.0, 2.0}, {3.0, 4.0}, {5.0, 6.0}};
  Bytes message;
  encode(Views{7, points, 8.0}, message);
  points.assign(3, Point{});
  Views back;
  ASSERT_TRUE(decode(message, back));
  EXPECT_EQ(back.number, 7);
  EXPECT_EQ(back.after, 8.0);
  ASSERT_EQ(back.points.size(), 3u);
  EXPECT_EQ(back.points[2], (Point{5.0, 6.0}));
  const auto* p = reinterpret_cast<const std::byte*>(back.points.data());
  EXPECT_TRUE(p >= message.data() && p < message.data() + message.size());
  Copied copied;  // a vector reads what a span wrote
  ASSERT_TRUE(decode(message, copied));
  EXPECT_EQ(copied.points[1], (Point{3.0, 4.0}));
}

TEST(Transfer, LetsAClassSayWhatTravels) {
  Bytes message;
  Nested in{{3, {{1.0, 1.0}}, "f"}, Closed(5)}, back;
  encode(in, message);
  ASSERT_TRUE(decode(message, back));
  EXPECT_EQ(back.frame, in.frame);
  EXPECT_EQ(back.closed, in.closed);
}

TEST(Transfer, AnswersAMessageThatIsCutShortOfAnotherTypeOrVersionWithAnError) {
  std::mt19937 random(2);
  Bytes message;
  const Input in = random_input(random);
  encode(in, message);
  Input back;
  for (std::size_t n = 0; n < message.size(); ++n) EXPECT_FALSE(decode(std::span(message).first(n), back)) << n;
  Frame other;
  const auto another = decode(message, other);
  ASSERT_FALSE(another);
  EXPECT_NE(another.error().message.find("another type"), std::string::npos) << another.error();
  message[4] = std::byte{9};
  const auto version = decode(message, back);
  ASSERT_FALSE(version);
  EXPECT_EQ(version.error().message, "a transferred value: expected version 1, found 9");
}

// Whatever is damaged, nothing is read beyond the message and no memory is asked for that it does not justify; sizes
// that no longer fit are an error.
TEST(Transfer, SurvivesDamageAnywhere) {
  std::mt19937 random(3);
  Bytes message;
  Input back;
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    encode(random_input(random), message);
    for (int hits = 1 + static_cast<int>(random() % 3); hits > 0; --hits)
      message[random() % message.size()] = static_cast<std::byte>(random());
    refused += !decode(message, back);
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace oriel
