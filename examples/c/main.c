/* SPDX-License-Identifier: BSD-3-Clause */
/* A robot drives ten metres, pose by pose, and recognises where it began: an estimator follows. */
#include <cairn.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void check(cairn_code code) {
  if (code == CAIRN_OK) return;
  fprintf(stderr, "corridor: %s\n", cairn_error());
  exit(code);
}

int main(void) {
  const double origin[] = {0, 0, 0};                       /* x y [m], heading [rad] */
  const double step[] = {1, 0, 0};                         /* odometry */
  const double seen[] = {10.2, 0, 0};                      /* of pose 10 from pose 0 */
  const double rough[] = {100, 0, 0, 100, 0, 400};         /* information: sigmas 0.1 m, 0.05 rad */
  const double exact[] = {2500, 0, 0, 2500, 0, 10000};     /* 0.02 m, 0.01 rad */
  double pose[3], Sigma[9];
  cairn_report report;
  cairn_registry* registry = NULL;
  cairn_estimator* robot = NULL;

  check(cairn_registry_new(NULL, 0, &registry));
  check(cairn_estimator_new(registry, "incremental_cholesky", &robot));
  check(cairn_estimator_add_variable(robot, "VERTEX_SE2", 0, origin, 3, 1));
  for (int64_t k = 1; k <= 10; ++k) {
    const int64_t ends[] = {k - 1, k}, loop[] = {0, k};
    check(cairn_estimator_add_variable(robot, "VERTEX_SE2", k, NULL, 0, 0)); /* initialised by its odometry */
    check(cairn_estimator_add_factor(robot, "EDGE_SE2", ends, 2, step, 3, rough, 6));
    if (k == 10) check(cairn_estimator_add_factor(robot, "EDGE_SE2", loop, 2, seen, 3, exact, 6));
    check(cairn_estimator_update(robot, NULL, &report));
    if (!report.ok) fputs(cairn_estimator_notes(robot), stderr);
  }
  check(cairn_estimator_estimate(robot, 10, pose, 3));
  check(cairn_estimator_covariance(robot, 10, 10, Sigma, 9));
  printf("pose 10: x %.3f m, sigma %.3f m\n", pose[0], sqrt(Sigma[0]));
  cairn_estimator_free(robot);
  cairn_registry_free(registry);
  return 0;
}
