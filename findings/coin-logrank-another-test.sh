#!/usr/bin/env bash
# R's coin 1.4-2 beside survival 3.5-3 (Debian 12): the log-rank test of eight runs has p = 0.007 in
# one and 0.039 in the other.
#
# Expected: `logrank_test` and `survdiff` of the same times, none tied, none censored, differ in the
# digits.
# Seen: chi-square is 7.34 by survdiff and 4.27 by coin. coin takes the variance over permutations
# of the groups, survdiff the hypergeometric one of each event. By all 70 permutations p is 0.029.
# Tied times add a choice: 4.38, 4.80 or 4.97 by `ties.method`, against 6.94.
# So: with few runs take `distribution = "exact"` and name the package; p values of log-rank tests
# from two papers cannot be compared at n = 4.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq r-base-core=4.2.2.20221110-2 r-cran-survival=3.5-3-1 r-cran-coin=1.4-2-1+b1 r-cran-libcoin r-cran-matrixstats \
    r-cran-modeltools r-cran-mvtnorm r-cran-multcomp r-cran-th.data r-cran-sandwich r-cran-zoo r-cran-codetools r-cran-mass \
    r-cran-matrix r-cran-lattice libblas3 liblapack3 libgfortran5 libtirpc3 libtcl8.6 libtk8.6 libicu72 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
R_HOME=$dir/root/usr/lib/R
library=$dir/root/usr/lib/x86_64-linux-gnu
export R_HOME LD_LIBRARY_PATH=$R_HOME/lib:$library:$library/blas:$library/lapack R_LIBS=$R_HOME/site-library:$R_HOME/library
"$R_HOME/bin/exec/R" --no-echo --no-save --no-restore --no-environ <<'R'
suppressMessages({library(survival); library(coin)})
runs <- data.frame(time = 1:8, end = 1, planner = factor(rep(c("a", "b"), each = 4)))
tied <- transform(runs, time = c(1, 1, 2, 2, 3, 3, 4, 4))
square <- function(data, ...) round(as.numeric(statistic(logrank_test(Surv(time, end) ~ planner, data = data, ...)))^2, 2)
score <- function(data) round(survdiff(Surv(time, end) ~ planner, data = data)$chisq, 2)
p <- function(square) round(pchisq(square, 1, lower.tail = FALSE), 3)
exact <- round(as.numeric(pvalue(logrank_test(Surv(time, end) ~ planner, data = runs, distribution = "exact"))), 3)
cat("no ties: survdiff", score(runs), "p", p(score(runs)), "- coin", square(runs), "p", p(square(runs)), "exact p", exact, "\n")
methods <- c("mid-ranks", "Hothorn-Lausen", "average-scores")
ties <- sapply(methods, function(method) square(tied, ties.method = method))
cat("tied: survdiff", score(tied), "- coin", paste(methods, ties), "\n")
found <- unname(c(score(runs), square(runs), exact, score(tied), sort(ties)))
if (!isTRUE(all.equal(found, c(7.34, 4.27, 0.029, 6.94, 4.38, 4.80, 4.97)))) stop("changed: found are ", deparse(found))
R
