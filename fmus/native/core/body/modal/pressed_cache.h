/* The complex modes of a body on its present stops, kept for each set of stops on which it has rested.
 *
 * A body that chatters changes between few sets of stops, and returns to each of them many times. Modes of several
 * stops cost thousands of evaluations of a motion. The cache is no part of the state: its contents follow from the
 * body. Kept modes have the bits of modes that are found again.
 */
#ifndef VIBROIMPACT_PRESSED_CACHE_H
#define VIBROIMPACT_PRESSED_CACHE_H

#include "body/modal/state.h"
#include "modes/coupled_modes.h"
#include "modes/coupled_response.h"
#include "modes/pressed_terms.h"

/* Sets of stops whose modes are kept; a further set replaces the one that was used longest ago. */
enum { VI_PRESSED_SETS = 32 };

/* Observed quantities: displacements of the contacts and of the observed point, and forces of the contacts. */
enum { VI_SEEN_OBSERVED = VI_PORTS, VI_SEEN_FORCE, VI_SEEN = VI_SEEN_FORCE + VI_PORTS };

/* Knowledge of the modes of a set: not found, for one contact, or for all contacts. */
typedef enum { VI_MODES_NOT_FOUND = 0, VI_MODES_OF_ONE = 1, VI_MODES_OF_ALL = 2 } vi_modes_known;

/* The body's modes on one set of stops. */
typedef struct {
    int32_t known;          /* vi_modes_known */
    int32_t searched;       /* the modes of all contacts have been searched for */
    int32_t contacts, rows; /* of the body: contacts, and with further observed points */
    int32_t port[VI_PORTS]; /* contact of the body, for each pressed contact */
    vi_pressed_body body;
    double shape[VI_PORTS][VI_MODES], observed[VI_MODES];
    vi_pressed_modes modes;
    vi_complex weight[VI_SEEN][VI_TERMS]; /* of each term in the observed quantities */
    vi_coupled_equations still, harmonic; /* of the responses */
} vi_pressed;

struct vi_pressed_cache {
    int64_t searches; /* in the cache */
    int64_t spent;    /* on finding modes, in evaluations of one mode */
    vi_pressed_body present; /* the body on its present contacts */
    uint64_t stops[VI_PRESSED_SETS]; /* of each set, one bit for each contact; 0: the place is empty */
    int64_t used[VI_PRESSED_SETS];   /* number of the last search that the set answered */
    vi_pressed set[VI_PRESSED_SETS];
    vi_coupled_work work;
};

/* Find the contacts on which the body rests, all others being free. Returns their number; 0 where the motion is not
 * linear. It is not on a power law, on a force from another FMU, or on a stop whose point others hold. */
int vi_pressed_contacts(const vi_structure *s, int32_t port[VI_PORTS]);

/* The modes of the body on its present contacts; NULL where they do not give its motion to the last digits. `all`:
 * modes of several contacts, or of coupling or strong damping, are worth their cost. This cost counts for no budget,
 * since the cache is no part of the state. */
const vi_pressed *vi_pressed_find(const vi_structure *s, bool all);

#endif
