// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/line_server.hpp"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/socket_client.hpp"

namespace cairn {
namespace {

using test::SocketClient;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

/// SET text changes, and is answered by as many x as the number after it; ESTIMATE ALL answers with
/// all that was set; FAIL ends the session; everything else is refused.
class Notebook final : public LineSession {
 public:
  Estimator& estimator() override { throw std::logic_error("not asked for"); }
  std::int64_t variable_count() const override { return std::ssize(set_); }
  std::int64_t factor_count() const override { return 0; }
  bool is_variable_type(std::string_view) const override { return false; }

 private:
  void perform(std::string_view text, const Words& words, Reply& reply) override {
    if (words[0] == "FAIL") throw std::runtime_error("failed");
    if (words[0] == "ESTIMATE") {
      for (const std::string& one : set_) reply.text += one + '\n';
    } else if (words[0] == "SET") {
      set_.emplace_back(text);
      reply.changes = true;
      if (words.size() > 2)
        reply.text = std::string(static_cast<std::size_t>(parse_whole(words[2], "number")), 'x');
      if (!reply.text.empty()) reply.text += '\n';
    } else {
      throw bad_line("ReadOptions::unknown");
    }
    acknowledge(reply);
  }

  std::vector<std::string> set_;
};

class LineServerTest : public ::testing::Test {
 protected:
  LineServerTest() {
    std::string name = (std::filesystem::temp_directory_path() / "cairn-socket-XXXXXX").string();
    if (!::mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
    folder_ = name;
    file_ = (folder_ / "socket").string();
  }
  ~LineServerTest() override {
    stop();
    server_.reset();
    std::filesystem::remove_all(folder_);
  }

  void serve(LineServerSettings settings = {}) {
    server_ = std::make_unique<LineServer>(file_, conversation_, std::move(settings));
    thread_ = std::thread([this] {
      try {
        server_->serve(stop_);
      } catch (...) {
        failure_ = std::current_exception();
        server_.reset();  // as a program that ends
      }
    });
  }
  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  SocketClient client() const { return SocketClient(file_); }
  /// A client that has become the writer, once the one before it is gone.
  SocketClient writer() const {
    SocketClient client(file_);
    while (!client.ask("WRITE").at(0).starts_with("WRITER")) std::this_thread::yield();
    return client;
  }

  std::filesystem::path folder_;
  std::string file_;
  Notebook notebook_;
  Conversation conversation_{notebook_};
  std::unique_ptr<LineServer> server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
  std::exception_ptr failure_;
};

TEST_F(LineServerTest, AWriterThatGoesWithoutReadingIsTakenToItsLastLine) {
  serve();
  constexpr int kLines = 3000;
  {
    SocketClient gone = writer();
    std::string all;
    for (int k = 0; k < kLines; ++k) all += "SET " + std::to_string(k) + " 20\n";
    ASSERT_TRUE(gone.tell_bytes(all));
  }  // no answer was read
  SocketClient next = writer();
  EXPECT_THAT(next.ask("ESTIMATE ALL"), SizeIs(kLines + 1));
}

TEST_F(LineServerTest, OneClientWritesAndOthersAsk) {
  serve();
  SocketClient robot = client(), reader = client();
  EXPECT_THAT(robot.ask("SET a"), ElementsAre("OK 1 variables 1 factors 0 owed 0"));
  EXPECT_THAT(robot.ask("SET b"), ElementsAre("OK 2 variables 2 factors 0 owed 0"));
  // Numbered by its own lines: the number of the stream is the writer's.
  EXPECT_THAT(reader.ask("ESTIMATE ALL"),
              ElementsAre("SET a", "SET b", "OK 1 variables 2 factors 0 owed 0"));
  EXPECT_THAT(reader.ask("SET c"), ElementsAre(StartsWith("ERROR line 2: SET is for the client")));
  EXPECT_THAT(reader.ask("WRITE"), ElementsAre(StartsWith("ERROR line 3: another client writes")));
  EXPECT_THAT(robot.ask("SET c"), ElementsAre("OK 3 variables 3 factors 0 owed 0"));
  EXPECT_THAT(robot.ask("ESTIMATE ALL"), SizeIs(4));
  EXPECT_THAT(robot.ask("WRITE"), ElementsAre("WRITER 4 variables 3 factors 0"));
  stop();
  EXPECT_EQ(server_->counts().clients, 2);
  EXPECT_EQ(server_->counts().most_clients, 2);
  EXPECT_EQ(server_->counts().writers, 1);
  EXPECT_EQ(conversation_.counts().questions, 1);
  EXPECT_EQ(conversation_.counts().lines, 4);
}

TEST_F(LineServerTest, TheNextClientWritesWhenTheWriterHasGone) {
  serve();
  SocketClient next = client();
  {
    SocketClient first = client();
    first.ask("SET a");
    EXPECT_THAT(next.ask("SET b"), ElementsAre(StartsWith("ERROR")));
  }
  std::vector<std::string> answer;
  do answer = next.ask("WRITE");
  while (answer.at(0).starts_with("ERROR"));
  EXPECT_THAT(answer, ElementsAre("WRITER 1 variables 1 factors 0"));
  EXPECT_THAT(next.ask("SET b"), ElementsAre("OK 2 variables 2 factors 0 owed 0"));
}

TEST_F(LineServerTest, ALineThatIsRefusedMakesNobodyTheWriter) {
  serve(LineServerSettings{.rephrase = [](std::string text) {
    return text.replace(text.find("ReadOptions::unknown"), 20, "--unknown");
  }});
  SocketClient reader = client(), robot = client();
  EXPECT_THAT(reader.ask("ESTMATE 3"), ElementsAre("ERROR line 1: --unknown"));
  EXPECT_THAT(robot.ask("SET a"), ElementsAre("OK 1 variables 1 factors 0 owed 0"));
  EXPECT_THAT(robot.ask("ESTMATE 3"), ElementsAre("ERROR line 2: --unknown"));
  EXPECT_THAT(robot.ask("SET b"), ElementsAre("OK 3 variables 2 factors 0 owed 0"));
}

TEST_F(LineServerTest, WhoFollowsGetsWhatTheWriterIsAnswered) {
  serve();
  SocketClient robot = writer(), follower = client();
  EXPECT_THAT(follower.ask("FOLLOW"), ElementsAre("FOLLOWS 0 variables 0 factors 0"));
  robot.ask("SET a 3");
  robot.ask("ESTIMATE ALL");  // changes nothing
  robot.ask("WHAT");
  robot.ask("SET b");
  EXPECT_THAT(follower.hear_answer(),
              ElementsAre("UPDATE 1", "xxx", "OK 1 variables 1 factors 0 owed 0"));
  EXPECT_THAT(follower.hear_answer(), ElementsAre("UPDATE 4", "OK 4 variables 2 factors 0 owed 0"));
  EXPECT_THAT(follower.ask("FOLLOW OFF"), ElementsAre("OFF 4 variables 2 factors 0"));
  robot.ask("SET c");
  EXPECT_THAT(follower.ask("ESTIMATE ALL"), SizeIs(4));
  EXPECT_THAT(follower.ask("FOLLOW ME"), ElementsAre(StartsWith("ERROR line 4: FOLLOW ME")));
}

/// Updates of "SET a 997" and one of "SET last", one after the other, or a note of how many are
/// missing.
void expect_whole_updates(const std::vector<std::string>& heard, int count) {
  int number = 0;
  for (std::size_t k = 0; k < heard.size(); ++k) {
    int dropped = 0;
    if (std::sscanf(heard[k].c_str(), "NOTE %d updates were dropped", &dropped) == 1) {
      number += dropped;
      continue;
    }
    EXPECT_EQ(heard[k], "UPDATE " + std::to_string(++number));
    if (number <= count) {
      ASSERT_LT(k + 1, heard.size());
      EXPECT_EQ(heard[++k], std::string(997, 'x'));
    }
    ASSERT_LT(k + 1, heard.size());
    EXPECT_THAT(heard[++k], StartsWith("OK " + std::to_string(number) + " "));
  }
  EXPECT_EQ(number, count + 1);
}

TEST_F(LineServerTest, AReaderThatNeverReadsCostsItsUpdatesAlone) {
  constexpr int kUpdates = 2000;
  serve(LineServerSettings{.max_unread = 10000});
  SocketClient robot = writer(), follower = client(), late = client();
  follower.ask("FOLLOW");
  late.ask("FOLLOW");
  std::vector<std::string> heard;  // by the one that reads
  std::thread reads([&] {
    while (std::optional<std::string> line = follower.hear()) heard.push_back(std::move(*line));
  });
  for (int k = 1; k <= kUpdates; ++k)
    ASSERT_THAT(robot.ask("SET a 997").back(), StartsWith("OK " + std::to_string(k) + " "));
  // What the socket took, and 10,000 bytes and one update more at most: then how many are missing.
  int whole = 0, dropped = 0;
  std::string line = late.hear().value();
  for (; line.starts_with("UPDATE "); line = late.hear().value()) {
    ++whole;
    EXPECT_EQ(line, "UPDATE " + std::to_string(whole));
    EXPECT_EQ(late.hear(), std::string(997, 'x'));
    EXPECT_THAT(late.hear().value(), StartsWith("OK " + std::to_string(whole) + " "));
  }
  ASSERT_EQ(std::sscanf(line.c_str(), "NOTE %d updates were dropped", &dropped), 1) << line;
  EXPECT_GT(dropped, 0);
  EXPECT_EQ(whole + dropped, kUpdates);
  EXPECT_THAT(late.ask("ESTIMATE ALL"), SizeIs(kUpdates + 1));
  robot.ask("SET last");
  EXPECT_THAT(late.hear_answer(), ElementsAre("UPDATE 2001", StartsWith("OK 2001 ")));
  stop();
  reads.join();
  expect_whole_updates(heard, kUpdates);
  EXPECT_GE(server_->counts().dropped, dropped);
}

TEST_F(LineServerTest, WhoAsksWithoutReadingIsReadNoMore) {
  serve(LineServerSettings{.max_unread = 10000});
  SocketClient robot = writer();
  for (int k = 0; k < 1000; ++k) robot.ask("SET a");
  constexpr int kQuestions = 20000;  // 120 MB of answers, and 260 kB of questions
  SocketClient reader = client();
  std::thread asks([&] {
    std::string questions;
    for (int k = 0; k < kQuestions; ++k) questions += "ESTIMATE ALL\n";
    reader.tell_bytes(questions);
  });
  for (int k = 0; k < 1000; ++k) ASSERT_THAT(robot.ask("SET b"), SizeIs(1));
  stop();  // with what it has not taken, the connection ends
  int answers = 0;
  std::vector<std::string> answer;
  for (; !(answer = reader.hear_answer()).empty() && test::ends_answer(answer.back()); ++answers)
    EXPECT_GE(answer.size(), 1001U);
  EXPECT_GT(answers, 0);
  EXPECT_LT(answers, kQuestions);
  asks.join();
}

TEST_F(LineServerTest, AnswersInJsonWhereAClientWantsIt) {
  serve();
  SocketClient robot = writer(), reader = client(), plain = client();
  plain.ask("FOLLOW");
  reader.tell("JSON");
  EXPECT_EQ(reader.hear(), R"({"answer":"JSON","line":0,"variables":0,"factors":0})");
  reader.tell("FOLLOW");
  EXPECT_EQ(reader.hear(), R"({"answer":"FOLLOWS","line":0,"variables":0,"factors":0})");
  robot.ask("SET a");
  EXPECT_EQ(reader.hear(),
            R"({"update":1,"answer":"OK","line":1,"variables":1,"factors":0,"owed":0})");
  EXPECT_THAT(plain.hear_answer(), ElementsAre("UPDATE 1", "OK 1 variables 1 factors 0 owed 0"));
  reader.tell("SET b");
  EXPECT_THAT(reader.hear().value(), StartsWith(R"({"answer":"ERROR","line":3,"message":"SET is)"));
  EXPECT_THAT(reader.ask("JSON OFF"), ElementsAre("OFF 1 variables 1 factors 0"));
}

/// What a client sends is repeated in messages: cut, and escaped where it is no text.
TEST_F(LineServerTest, RepeatsNoBytesThatAreNoText) {
  serve();
  SocketClient robot = writer(), reader = client();
  robot.ask("SET a");
  EXPECT_THAT(reader.ask("\xd3\xfc\x8b 1 2"),
              ElementsAre(StartsWith(R"(ERROR line 1: \xd3\xfc\x8b is for the client)")));
  EXPECT_THAT(reader.ask("JSON \xff"), ElementsAre(HasSubstr(R"(JSON \xff; expected 'JSON')")));
  EXPECT_LT(reader.ask(std::string(100000, 'x')).front().size(), 300U);
  reader.tell("JSON");
  reader.hear();
  reader.tell("\xd3\xfc\x8b 1 2");
  EXPECT_THAT(reader.hear().value(), HasSubstr(R"("message":"\\xd3\\xfc\\x8b is for)"));
}

TEST_F(LineServerTest, AnswersWhatCameBeforeTheEndOfInput) {
  serve();
  SocketClient robot = client();
  robot.tell_bytes("SET a\r\n\n# nothing\nSET b 5\nSET half");
  robot.end_input();
  EXPECT_THAT(robot.hear_answer(), ElementsAre("OK 1 variables 1 factors 0 owed 0"));
  EXPECT_THAT(robot.hear_answer(), ElementsAre("xxxxx", "OK 4 variables 2 factors 0 owed 0"));
  EXPECT_EQ(robot.hear(), std::nullopt);
  EXPECT_EQ(robot.rest(), "");
}

TEST_F(LineServerTest, QuitEndsOneConnection) {
  serve();
  SocketClient robot = client();
  robot.ask("SET a");
  EXPECT_THAT(robot.ask("QUIT"), ElementsAre("CLOSED 1 variables 1 factors 0"));
  EXPECT_EQ(robot.hear(), std::nullopt);
  EXPECT_THAT(client().ask("ESTIMATE ALL"), ElementsAre("SET a", StartsWith("OK 1 ")));
}

TEST_F(LineServerTest, RefusesALineWithoutEnd) {
  serve(LineServerSettings{.max_line = 100'000});
  SocketClient robot = client(), other = client();
  robot.tell_bytes(std::string(150'000, 'a'));
  EXPECT_THAT(robot.hear_answer(),
              ElementsAre("ERROR line 1: of more than 100000 bytes; expected text"));
  EXPECT_EQ(robot.hear(), std::nullopt);
  EXPECT_THAT(other.ask("SET a"), ElementsAre(StartsWith("OK 1 ")));
}

TEST_F(LineServerTest, RefusesMoreClientsThanItMayHave) {
  serve(LineServerSettings{.max_clients = 2});
  SocketClient first = client();
  first.ask("ESTIMATE ALL");
  {
    SocketClient second = client();
    second.ask("ESTIMATE ALL");
    SocketClient third = client();
    EXPECT_THAT(third.hear_answer(), ElementsAre(StartsWith("ERROR line 0: 2 clients")));
    EXPECT_EQ(third.hear(), std::nullopt);
  }
  std::vector<std::string> answer;
  do {  // until the others are seen to have gone
    SocketClient another = client();
    answer = another.ask("ESTIMATE ALL");
  } while (!answer.back().starts_with("OK"));
}

TEST_F(LineServerTest, StopsWithWhatWasAnsweredSentAndTheFileRemoved) {
  serve();
  SocketClient robot = client();
  robot.ask("SET a");
  struct stat there {};
  ASSERT_EQ(::stat(file_.c_str(), &there), 0);
  EXPECT_EQ(there.st_mode & 07777, 0600U);
  stop();
  EXPECT_EQ(robot.hear(), std::nullopt);
  server_.reset();
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(LineServerTest, AFailureEndsItAndIsHandedOn) {
  serve();
  SocketClient robot = client();
  robot.tell("FAIL");
  EXPECT_EQ(robot.hear(), std::nullopt);
  stop();
  ASSERT_TRUE(failure_);
  EXPECT_THROW(std::rethrow_exception(failure_), std::runtime_error);
  EXPECT_FALSE(std::filesystem::exists(file_));
}

// The file ----------------------------------------------------------------------------------------

std::string refusal(const std::string& file, Conversation& conversation) {
  try {
    const LineServer server(file, conversation, {});
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST_F(LineServerTest, TakesThePlaceOfASocketThatNobodyListensOn) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, file_.c_str(), file_.size() + 1);
  const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(::bind(left, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(left);
  ASSERT_TRUE(std::filesystem::is_socket(file_));
  serve();
  EXPECT_THAT(client().ask("SET a"), ElementsAre(StartsWith("OK 1 ")));
}

TEST_F(LineServerTest, LeavesASocketThatSomebodyListensOn) {
  serve();
  EXPECT_THAT(refusal(file_, conversation_), EndsWith("another process listens there; end it, or "
                                                      "name another file"));
  EXPECT_THAT(client().ask("SET a"), ElementsAre(StartsWith("OK 1 ")));
}

TEST_F(LineServerTest, LeavesWhatIsNoSocket) {
  std::ofstream(file_) << "precious";
  EXPECT_THAT(refusal(file_, conversation_), HasSubstr("is there and is no socket"));
  EXPECT_EQ(std::filesystem::file_size(file_), 8U);
  EXPECT_THAT(refusal((folder_ / "none" / "socket").string(), conversation_),
              HasSubstr("its folder cannot be opened: No such file"));
  EXPECT_THAT(refusal(std::string(200, 'a'), conversation_), HasSubstr("expected 1 to 107 bytes"));
}

TEST_F(LineServerTest, LeavesAnotherFileThatHasTakenItsPlace) {
  serve();
  std::filesystem::remove(file_);
  std::ofstream(file_) << "precious";
  stop();
  server_.reset();
  EXPECT_EQ(std::filesystem::file_size(file_), 8U);
}

}  // namespace
}  // namespace cairn
