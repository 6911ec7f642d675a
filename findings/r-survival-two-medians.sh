#!/usr/bin/env bash
# R's survival 3.5-3 (Debian 12): one fit has two medians, 2 and 3.
#
# Expected: `quantile(fit, 0.5)` and the median of `summary(fit)$table` (and of `print`) are one
# number.
# Seen: of four runs two end at 1 and 2 s, two are stopped at 3 and 4 s: half are left from 2 s on,
# to the end. The table says 2, the quantile 3, the middle of the flat piece. If the curve falls
# again, both say the middle. With 0.499 and 0.501 instead of 0.5 it is 2 and nothing.
# So: a table of medians and a figure with lines at quantiles disagree by up to half the length of
# the experiment where just half of the runs reach their goal; say which call a median is from.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq r-base-core=4.2.2.20221110-2 r-cran-survival=3.5-3-1 r-cran-matrix r-cran-lattice libblas3 liblapack3 \
    libgfortran5 libtirpc3 libtcl8.6 libtk8.6 libicu72 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
R_HOME=$dir/root/usr/lib/R
library=$dir/root/usr/lib/x86_64-linux-gnu
export R_HOME LD_LIBRARY_PATH=$R_HOME/lib:$library:$library/blas:$library/lapack R_LIBS=$R_HOME/site-library:$R_HOME/library
"$R_HOME/bin/exec/R" --no-echo --no-save --no-restore --no-environ <<'R'
suppressMessages(library(survival))
both <- function(...) {
    fit <- survfit(Surv(c(1, 2, 3, 4), c(...)) ~ 1)
    c(table = summary(fit)$table[["median"]], quantile = quantile(fit, 0.5)$quantile[[1]])
}
found <- list("stopped at 3 and 4 s" = both(1, 1, 0, 0), "all end" = both(1, 1, 1, 1))
for (name in names(found)) cat(name, "- table:", found[[name]][1], "quantile:", found[[name]][2], "\n")
fit <- survfit(Surv(c(1, 2, 3, 4), c(1, 1, 0, 0)) ~ 1)
near <- quantile(fit, c(0.499, 0.501))$quantile
cat("quantiles 0.499 and 0.501:", near, "\n")
if (!identical(unname(c(found[[1]], found[[2]])), c(2, 3, 2.5, 2.5))) stop("changed: medians are ", deparse(found))
if (near[1] != 2 || !is.na(near[2])) stop("changed: beside the half they are ", deparse(near))
R
