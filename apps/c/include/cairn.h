/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * cairn for C, and for all languages that call C: graph SLAM whose solvers and types are plugins, chosen by name.
 * docs/c.md has an example, and the rules that hold for all functions:
 *
 * - What can fail returns a cairn_code, and CAIRN_OK if it did not. The reason is cairn_error(), a sentence. No exception
 *   leaves a function, and a call that failed has changed nothing, unless it says so.
 * - Objects are opaque, made by functions whose last argument receives them, and freed by the function of that name, which
 *   takes NULL too. They may be freed in any order.
 * - Text is UTF-8 and ends with a zero. Text that a function hands out belongs to the object, and is good until the next
 *   call with it.
 * - Arrays have their number of elements beside them, which must be right: CAIRN_USAGE says what is expected. Matrices are
 *   row by row. Lengths are metres and angles radians, unless a type defines something else.
 * - An object is used by one thread at a time; different objects may be used by different threads.
 */
#ifndef CAIRN_H
#define CAIRN_H

#include <stddef.h>
#include <stdint.h>

#ifdef CAIRN_C_BUILD
#define CAIRN_C_API __attribute__((visibility("default")))
#else
#define CAIRN_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Errors ------------------------------------------------------------------------------------------------------------- */

/* The exit codes of the program cairn. */
typedef enum cairn_code {
  CAIRN_OK = 0,
  CAIRN_INTERNAL = 1,  /* a bug of cairn: please report it */
  CAIRN_USAGE = 2,     /* a bad call: NULL, unknown option or id, wrong size of an array */
  CAIRN_INPUT = 3,     /* a bad file or bad data */
  CAIRN_NUMERICAL = 4, /* a number that does not exist; or memory or threads that the system does not give */
  CAIRN_PLUGIN = 5     /* a name that no plugin offers; a plugin that is broken or does not fit */
} cairn_code;

/* Why the last call in this thread that failed did so: what, where, and what would work. Never NULL; good until the next
 * call in this thread. */
CAIRN_C_API const char* cairn_error(void);

/* "0.1.0" */
CAIRN_C_API const char* cairn_version(void);
/* How many threads are used from now on; 0: all cores. Results do not depend on it. */
CAIRN_C_API cairn_code cairn_set_threads(int count);

/* Plugins ------------------------------------------------------------------------------------------------------------ */

/* Where types, formats and solvers come from. Graphs and estimators work together if they come from the same one. */
typedef struct cairn_registry cairn_registry;

/* Plugins are looked for in `folders`, and then where the program cairn looks: the folders of CAIRN_PLUGIN_PATH, of the
 * user, and beside the library. Without folders, 0 and NULL. */
CAIRN_C_API cairn_code cairn_registry_new(const char* const* folders, size_t folder_count, cairn_registry** registry);
CAIRN_C_API void cairn_registry_free(cairn_registry* registry);
/* The names of a kind ("variable", "factor", "format", "optimizer", "linear_solver", "initial_guess", "loss",
 * "estimator", …), one per line. */
CAIRN_C_API cairn_code cairn_registry_names(cairn_registry* registry, const char* kind, const char** names);
/* Options of types, such as "slam3d:metric=g2o", before the first of them is used. */
CAIRN_C_API cairn_code cairn_registry_set_type_options(cairn_registry* registry, const char* spec);

/* Graphs ------------------------------------------------------------------------------------------------------------- */

/* Variables with states (the estimate), each known by an id, and factors, which are measurements on them. */
typedef struct cairn_graph cairn_graph;

/* An empty graph. */
CAIRN_C_API cairn_code cairn_graph_new(cairn_registry* registry, cairn_graph** graph);
/* Reads a file. `format`: its name ("g2o"), or NULL: recognised by content. */
CAIRN_C_API cairn_code cairn_graph_read(cairn_registry* registry, const char* file, const char* format,
                                        cairn_graph** graph);
/* Writes a file as a whole or not at all. `format`: NULL: by the file's ending. */
CAIRN_C_API cairn_code cairn_graph_write(cairn_graph* graph, const char* file, const char* format);
CAIRN_C_API cairn_code cairn_graph_clone(cairn_graph* graph, cairn_graph** copy);
CAIRN_C_API void cairn_graph_free(cairn_graph* graph);
/* What is worth knowing of the last reading or optimisation, one sentence per line; "" if nothing is. */
CAIRN_C_API const char* cairn_graph_notes(const cairn_graph* graph);
/* Those notes of the last optimisation that give reason to doubt the estimate, one per line; "" if none does. */
CAIRN_C_API const char* cairn_graph_doubts(const cairn_graph* graph);

/* Adds a variable by the tag of its type ("VERTEX_SE2": x, y, theta). `id`: from 0. `fixed`: it is not estimated. */
CAIRN_C_API cairn_code cairn_graph_add_variable(cairn_graph* graph, const char* tag, int64_t id, const double* state,
                                                size_t state_size, int fixed);
/* Adds a factor by the tag of its type ("EDGE_SE2") on variables by id. `information`: the upper triangle row by row,
 * n(n+1)/2 numbers for a residual of n. */
CAIRN_C_API cairn_code cairn_graph_add_factor(cairn_graph* graph, const char* tag, const int64_t* ids, size_t id_count,
                                              const double* measurement, size_t measurement_size,
                                              const double* information, size_t information_size);
CAIRN_C_API cairn_code cairn_graph_set_fixed(cairn_graph* graph, int64_t id, int fixed);
/* The robust loss of all factors ("huber:scale=1"); NULL: none. */
CAIRN_C_API cairn_code cairn_graph_set_loss(cairn_graph* graph, const char* spec);

/* 0 if `graph` is NULL. */
CAIRN_C_API size_t cairn_graph_variable_count(const cairn_graph* graph);
CAIRN_C_API size_t cairn_graph_factor_count(const cairn_graph* graph);
/* The ids of all variables in the order of addition. `count` must be their number. */
CAIRN_C_API cairn_code cairn_graph_ids(cairn_graph* graph, int64_t* ids, size_t count);
/* A variable's type, and the sizes of its state and of its tangent space. What is NULL is not given. */
CAIRN_C_API cairn_code cairn_graph_variable(cairn_graph* graph, int64_t id, const char** tag, size_t* state_size,
                                            size_t* tangent_size);

/* How many numbers cairn_graph_states and cairn_graph_marginals give of these variables. In these functions NULL and 0
 * instead of ids stand for all variables, in the order of addition. */
CAIRN_C_API cairn_code cairn_graph_sizes(cairn_graph* graph, const int64_t* ids, size_t id_count, size_t* states,
                                         size_t* marginals);
/* The states of these variables, one after the other. */
CAIRN_C_API cairn_code cairn_graph_states(cairn_graph* graph, const int64_t* ids, size_t id_count, double* states,
                                          size_t size);
/* Replaces them. All of them, or none if one is not a state. */
CAIRN_C_API cairn_code cairn_graph_set_states(cairn_graph* graph, const int64_t* ids, size_t id_count,
                                              const double* states, size_t size);
/* The sum of rho(|r|^2) over all factors. */
CAIRN_C_API cairn_code cairn_graph_chi2(cairn_graph* graph, double* chi2);

/* Optimisation ------------------------------------------------------------------------------------------------------- */

typedef enum cairn_status {
  CAIRN_CONVERGED = 0,
  CAIRN_MAX_ITERATIONS = 1,
  CAIRN_DIVERGED = 2,
  CAIRN_NOT_POSITIVE_DEFINITE = 3,
  CAIRN_INTERRUPTED = 4
} cairn_status;

/* "converged", "max_iterations", …; "" for another number. */
CAIRN_C_API const char* cairn_status_name(int status);

/* One iteration: `chi2` is that of the estimate after it. */
typedef struct cairn_iteration {
  int number;       /* from 1; 0: the initial guess is being computed, and all members are 0 */
  int accepted;     /* whether the step was taken */
  double chi2;
  double step_norm; /* Euclidean, in the tangent space */
  double damping;   /* lambda, or 1 / radius of the trust region; 0 where there is none */
  double seconds;
} cairn_iteration;

/* When to stop, and a function that is called after each iteration. */
typedef struct cairn_stop {
  int max_iterations; /* 200 */
  double tolerance;   /* stop when a step could lower chi2 by less than this fraction: 1e-10 */
  double max_seconds; /* 0: no limit */
  /* Called after each iteration, and now and then during an initial guess that takes long, in the thread of the call;
   * another value than 0 stops the optimisation with the best estimate. It must not use the graph, or throw. NULL: is not
   * called. */
  int (*interrupt)(const cairn_iteration* iteration, void* data);
  void* data; /* for `interrupt` */
} cairn_stop;

/* Sets the values named above. */
CAIRN_C_API void cairn_stop_init(cairn_stop* stop);

typedef struct cairn_summary {
  cairn_status status;
  int iterations;
  double initial_chi2, final_chi2;
  double seconds;
} cairn_summary;

/* Minimises chi2, and leaves the best states found in the graph, however it ends: that is `status`, and no error.
 * `optimizer`: its name with options, such as "dogleg:linear_solver=cholmod"; NULL: "levenberg_marquardt". `initial`: the
 * initial guess; NULL: "auto", the best of several by chi2; "as_given": the states that the graph has. `stop` and
 * `summary` may be NULL. After an error the states may be those of the initial guess. */
CAIRN_C_API cairn_code cairn_graph_optimize(cairn_graph* graph, const char* optimizer, const char* initial,
                                            const cairn_stop* stop, cairn_summary* summary);

/* Marginal covariances of these variables at the present estimate: of each the matrix of its tangent space, one after the
 * other. `linear_solver`: NULL: "block_cholesky". CAIRN_NUMERICAL if the factors do not determine them. */
CAIRN_C_API cairn_code cairn_graph_marginals(cairn_graph* graph, const int64_t* ids, size_t id_count,
                                             const char* linear_solver, double* blocks, size_t size);
/* The cross covariance of two variables: as many rows as the tangent space of `a` has dimensions, columns of `b`. */
CAIRN_C_API cairn_code cairn_graph_covariance(cairn_graph* graph, int64_t a, int64_t b, const char* linear_solver,
                                              double* block, size_t size);

/* Estimators --------------------------------------------------------------------------------------------------------- */

/* Keeps the estimate of a graph up to date while it grows. What the next update consists of is collected first; it is
 * carried out as a whole by cairn_estimator_update. */
typedef struct cairn_estimator cairn_estimator;

/* `spec`: its name with options; NULL: "incremental_cholesky". */
CAIRN_C_API cairn_code cairn_estimator_new(cairn_registry* registry, const char* spec, cairn_estimator** estimator);
CAIRN_C_API void cairn_estimator_free(cairn_estimator* estimator);

/* For the next update: as of graphs. `state` may be NULL with size 0: the first factor of this update that can computes
 * it from the other variables. */
CAIRN_C_API cairn_code cairn_estimator_add_variable(cairn_estimator* estimator, const char* tag, int64_t id,
                                                    const double* state, size_t state_size, int fixed);
CAIRN_C_API cairn_code cairn_estimator_add_factor(cairn_estimator* estimator, const char* tag, const int64_t* ids,
                                                  size_t id_count, const double* measurement, size_t measurement_size,
                                                  const double* information, size_t information_size);
/* Replaces a measurement and, unless its size is 0, the information. */
CAIRN_C_API cairn_code cairn_estimator_change_factor(cairn_estimator* estimator, int64_t factor,
                                                     const double* measurement, size_t measurement_size,
                                                     const double* information, size_t information_size);
CAIRN_C_API cairn_code cairn_estimator_remove_factor(cairn_estimator* estimator, int64_t factor);
/* With all factors on it. */
CAIRN_C_API cairn_code cairn_estimator_remove_variable(cairn_estimator* estimator, int64_t id);
/* Removes a variable and keeps its information, as a prior on its neighbours. */
CAIRN_C_API cairn_code cairn_estimator_marginalize(cairn_estimator* estimator, int64_t id);

typedef struct cairn_update_options {
  int defer;          /* take in what is new, and solve later */
  int full;           /* relinearise and solve everything until it has converged */
  double max_seconds; /* 0: no limit */
} cairn_update_options;

typedef struct cairn_report {
  int ok;               /* 0: the measurements do not determine all variables; the estimate is the best available */
  int converged;        /* 0: everything was to be solved until it has converged, and has not */
  int64_t first_factor; /* number of the first new factor; the others follow it */
  int iterations;       /* linear systems solved */
  int owed;             /* factors whose relinearisation was deferred by the time limit */
  double seconds;
} cairn_report;

/* Carries out what was collected, or solves again if nothing was. After an error the estimator is as before, and what was
 * collected is discarded; CAIRN_INPUT where it names what is not in the estimator, or does not fit it. `options` (NULL: none
 * of them) and `report` may be NULL. */
CAIRN_C_API cairn_code cairn_estimator_update(cairn_estimator* estimator, const cairn_update_options* options,
                                              cairn_report* report);
/* Notes on the last update, one sentence per line. */
CAIRN_C_API const char* cairn_estimator_notes(const cairn_estimator* estimator);
/* What gives reason to doubt the estimate since the last update, one sentence per line; "" if nothing does. */
CAIRN_C_API const char* cairn_estimator_doubts(const cairn_estimator* estimator);

CAIRN_C_API size_t cairn_estimator_variable_count(const cairn_estimator* estimator);
CAIRN_C_API size_t cairn_estimator_factor_count(const cairn_estimator* estimator);
CAIRN_C_API cairn_code cairn_estimator_ids(cairn_estimator* estimator, int64_t* ids, size_t count);
/* The estimate of one variable; `size` must be that of its state. */
CAIRN_C_API cairn_code cairn_estimator_estimate(cairn_estimator* estimator, int64_t id, double* state, size_t size);
/* The covariance of two variables, which may be the same: rows of `a`, columns of `b`. */
CAIRN_C_API cairn_code cairn_estimator_covariance(cairn_estimator* estimator, int64_t a, int64_t b, double* block,
                                                  size_t size);
CAIRN_C_API cairn_code cairn_estimator_chi2(cairn_estimator* estimator, double* chi2);
/* Everything at the present estimate, as a graph of its own. */
CAIRN_C_API cairn_code cairn_estimator_graph(cairn_estimator* estimator, cairn_graph** graph);

/* Lines -------------------------------------------------------------------------------------------------------------- */

/* The protocol of `cairn online` (docs/online.md): a line in, its answer out. */
typedef struct cairn_session cairn_session;

typedef struct cairn_session_settings {
  const char* output;    /* estimates after a solve: "none", "last", "changed" or "all"; NULL: "last" */
  const char* marginals; /* covariances after a solve: "none", "last" or "diagonal"; NULL: "none" */
  const char* journal;   /* a file from which the session is restored, and to which it is written; NULL: none */
  int explicit_solve;    /* 1: solves at SOLVE and FULL alone */
  double budget;         /* seconds that an update may take; 0: no limit */
} cairn_session_settings;

/* `estimator`: NULL: "incremental_cholesky". `settings` may be NULL. With a journal the first answer is "RESTORED …". */
CAIRN_C_API cairn_code cairn_session_new(cairn_registry* registry, const char* estimator,
                                         const cairn_session_settings* settings, cairn_session** session);
CAIRN_C_API void cairn_session_free(cairn_session* session);
/* Takes one line, without its end. Its answer (`answer` may be NULL) consists of lines, each with its end, or is "". A
 * line that cannot be taken is answered by "ERROR line N: …", which is CAIRN_OK. What the journal cannot store is an
 * error, and so is a call after that. */
CAIRN_C_API cairn_code cairn_session_take(cairn_session* session, const char* line, const char** answer);
/* The latest answer. */
CAIRN_C_API const char* cairn_session_answer(const cairn_session* session);

#ifdef __cplusplus
}
#endif

#endif
