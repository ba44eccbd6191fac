// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/plugin_call.hpp"

#include <exception>
#include <new>

#include "cairn/runtime/callback_exit.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

void rethrow_as_plugin_error(const std::string& component) {
  try {
    throw;
  } catch (const Error&) {
    throw;
  } catch (const CallbackExit&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(ErrorCode::plugin, component + " failed: " + error.what());
  } catch (...) {
    throw Error(ErrorCode::plugin, component + " failed: it threw what is not a std::exception");
  }
}

}  // namespace cairn
