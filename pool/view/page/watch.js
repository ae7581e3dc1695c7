new Connection({ open() {}, lost() {} });
