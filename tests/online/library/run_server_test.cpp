// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/run_server.hpp"

#include <chrono>
#include <future>
#include <list>
#include <string>
#include <thread>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/runtime/error.hpp"
#include "support/http_client.hpp"

namespace cairn {
namespace {

using namespace std::chrono_literals;
using test::http_exchange;
using test::http_get;
using test::HttpAnswer;
using test::HttpConnection;
using testing::HasSubstr;

bool is_ready(const std::future<HttpAnswer>& answer) {
  return answer.wait_for(0s) == std::future_status::ready;
}

TEST(RunServer, HasThePageAndTheLinesSoFar) {
  RunServer server(0);
  server.show("<!doctype html>the page");
  for (int k = 0; k < 5; ++k) server.add(fmt::format("{{\"line\":{}}}\n", k));
  const HttpAnswer page = http_get(server.port(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.body, "<!doctype html>the page");
  EXPECT_THAT(page.head, HasSubstr("text/html"));
  EXPECT_THAT(page.head, HasSubstr("no-store"));
  const HttpAnswer lines = http_get(server.port(), "/lines?from=3");
  EXPECT_EQ(lines.status, 200);
  EXPECT_EQ(lines.body, "{\"line\":3}\n{\"line\":4}\n");
  EXPECT_EQ(http_get(server.port(), "/lines?from=0").body.size(), 5 * 11U);
}

TEST(RunServer, AnswersAsSoonAsThereIsALine) {
  RunServer server(0);
  server.add("{}\n");
  auto next =
      std::async(std::launch::async, [&] { return http_get(server.port(), "/lines?from=1"); });
  std::this_thread::sleep_for(50ms);
  EXPECT_FALSE(is_ready(next));
  server.add("{\"step\":0}\n");
  EXPECT_EQ(next.get().body, "{\"step\":0}\n");
  // The end is no line, and waits for none.
  auto rest =
      std::async(std::launch::async, [&] { return http_get(server.port(), "/lines?from=2"); });
  server.finish();
  EXPECT_EQ(rest.get().body, "");
  EXPECT_EQ(http_get(server.port(), "/lines?from=7").body, "");
}

TEST(RunServer, ItsEndWaitsForThoseWhoFollowAndForNobodyElse) {
  constexpr double kLong = 1000.0;  // [s], which no test has
  {
    RunServer server(0);
    server.add("{}\n");
    http_get(server.port(), "/");
    server.finish(kLong);
  }
  RunServer server(0);
  server.add("{}\n");
  http_get(server.port(), "/lines?from=0");
  server.add("{\"end\":\"limit\"}\n");
  auto end = std::async(std::launch::async, [&] { server.finish(kLong); });
  EXPECT_EQ(end.wait_for(50ms), std::future_status::timeout);
  EXPECT_EQ(http_get(server.port(), "/lines?from=1").body, "{\"end\":\"limit\"}\n");
  end.get();
  // A browser that does not ask again is not waited for beyond the timeout.
  RunServer left(0);
  http_get(left.port(), "/");
  left.add("{}\n");
  http_get(left.port(), "/lines?from=0");
  left.add("{}\n");
  left.finish(0.05);
}

TEST(RunServer, ItsEndWaitsForTheSlowestOfSeveral) {
  constexpr double kLong = 1000.0;  // [s], which no test has
  RunServer server(0);
  server.add("{}\n");
  HttpConnection fast(server.port()), slow(server.port()), of_another_run(server.port());
  EXPECT_EQ(fast.get("/lines?from=0").body, "{}\n");
  EXPECT_EQ(slow.get("/lines?from=0").body, "{}\n");
  server.add("{\"end\":\"limit\"}\n");
  EXPECT_EQ(fast.get("/lines?from=1").body, "{\"end\":\"limit\"}\n");
  auto end = std::async(std::launch::async, [&] { server.finish(kLong); });
  // A number beyond the end is no sign of the lines before it.
  EXPECT_EQ(of_another_run.get("/lines?from=70").body, "");
  EXPECT_EQ(end.wait_for(100ms), std::future_status::timeout);
  EXPECT_EQ(slow.get("/lines?from=1").body, "{\"end\":\"limit\"}\n");
  end.get();
  // A browser that has closed its connection is not waited for once another one has all lines.
  RunServer second(0);
  second.add("{}\n");
  { EXPECT_EQ(HttpConnection(second.port()).get("/lines?from=0").body, "{}\n"); }
  second.add("{}\n");
  HttpConnection stays(second.port());
  EXPECT_EQ(stays.get("/lines?from=0").body, "{}\n{}\n");
  second.finish(kLong);
}

TEST(RunServer, IsForBrowsersOfThisMachineThatRead) {
  RunServer server(0);
  server.add("{}\n");
  const auto ask = [&](const std::string& line, const std::string& host) {
    return http_exchange(
               server.port(),
               fmt::format("{} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", line, host))
        .status;
  };
  EXPECT_EQ(ask("GET /lines?from=0", "localhost:1234"), 200);  // through a tunnel
  EXPECT_EQ(ask("GET /lines?from=0", "robots.example"), 403);
  EXPECT_EQ(ask("GET /lines?from=0", "127.0.0.1.example:80"), 403);
  EXPECT_EQ(ask("GET /lines?from=0", ""), 403);
  EXPECT_EQ(ask("GET /lines?from=0", "localhost\r\nHost: localhost"), 400);
  EXPECT_EQ(ask("GET /lines?from=0", "localhost\r\nHost: robots.example"), 400);
  EXPECT_EQ(ask("GET http://localhost:80/lines?from=0", "localhost"), 200);
  EXPECT_EQ(ask("GET http://localhost", "localhost"), 200);
  EXPECT_EQ(ask("GET http://robots.example/lines?from=0", "localhost"), 403);
  EXPECT_EQ(ask("POST /", "localhost"), 405);
  for (const char* target : {"/lines", "/lines?from=", "/lines?from=-1", "/lines?from=1x",
                             "/lines?from=99999999999999999999999", "/../etc/passwd", "*"})
    EXPECT_EQ(ask(std::string("GET ") + target, "localhost"), 404) << target;
}

TEST(RunServer, TheHeadOfAnAnswerComesAlone) {
  RunServer server(0);
  server.show("the page");
  for (const char* target : {"/", "/lines?from=0"}) {
    const HttpAnswer answer = http_exchange(
        server.port(),
        fmt::format("HEAD {} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", target));
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.body, "");
  }
  EXPECT_THAT(http_exchange(server.port(),
                            "HEAD / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
                  .head,
              HasSubstr("Content-Length: 8"));
}

/// Any user of the machine can connect, and say nothing.
TEST(RunServer, WhoAsksForNothingKeepsNobodyOut) {
  RunServer server(0);
  server.show("the page");
  std::list<HttpConnection> silent;
  for (int k = 0; k < 200; ++k) silent.emplace_back(server.port());
  EXPECT_EQ(http_get(server.port(), "/").body, "the page");
}

TEST(RunServer, WhatIsNoRequestDisturbsNobody) {
  RunServer server(0);
  server.add("{}\n");
  EXPECT_EQ(http_exchange(server.port(), "\r\n\r\n\r\n").status, 400);
  EXPECT_EQ(http_exchange(server.port(), "GET\r\n\r\n").status, 400);
  EXPECT_EQ(
      http_exchange(server.port(), std::string("\x16\x03\x01\x00\xff\x00", 6) + "\r\n\r\n").status,
      400);
  http_exchange(server.port(), "GET /" + std::string(100000, 'x') + " HTTP/1.1\r\n\r\n");
  http_exchange(server.port(),
                "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999\r\n\r\nx");
  EXPECT_EQ(http_get(server.port(), "/lines?from=0").body, "{}\n");
}

TEST(RunServer, ALongRunIsSentInParts) {
  RunServer server(0);
  std::string line(1'000'000, 'x');
  line.back() = '\n';
  for (int k = 0; k < 12; ++k) server.add(line);
  std::size_t got = 0;
  for (int parts = 0; got < 12 && parts < 12; ++parts) {
    const HttpAnswer answer = http_get(server.port(), fmt::format("/lines?from={}", got));
    ASSERT_EQ(answer.status, 200);
    ASSERT_EQ(answer.body.size() % line.size(), 0U);
    ASSERT_LT(answer.body.size(), 6'000'000U);
    got += answer.body.size() / line.size();
  }
  EXPECT_EQ(got, 12U);
}

TEST(RunServer, APortThatIsTakenIsSaid) {
  const RunServer first(0);
  EXPECT_NE(first.port(), 0);
  try {
    const RunServer second(first.port());
    FAIL() << "two servers at one port";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::usage);
    EXPECT_THAT(error.what(), HasSubstr("another program does so; take another one, or 0"));
  }
}

TEST(RunServer, EndsWithConnectionsThatWait) {
  std::vector<std::future<HttpAnswer>> waiting;
  {
    RunServer server(0);
    for (int k = 0; k < 5; ++k) {
      waiting.push_back(std::async(
          std::launch::async, [port = server.port()] { return http_get(port, "/lines?from=0"); }));
    }
    std::this_thread::sleep_for(50ms);
  }
  for (auto& one : waiting) EXPECT_EQ(one.get().status, 0);
}

}  // namespace
}  // namespace cairn
